// The user's own mesh: a GLB (glTF 2.0, binary) or a PLY file, as {positions, normals, indices}.

import { EngineError } from "./errors.js";
import { fitted, joined, withNormals } from "./shapes.js";

const MOST = 3_000_000;
const READERS = {
  1: ["getInt8", 1], 2: ["getUint8", 1], 3: ["getInt16", 2], 4: ["getUint16", 2],
  5: ["getInt32", 4], 6: ["getUint32", 4], 7: ["getFloat32", 4], 8: ["getFloat64", 8],
};
const PLY_TYPES = {
  char: 1, int8: 1, uchar: 2, uint8: 2, short: 3, int16: 3, ushort: 4, uint16: 4,
  int: 5, int32: 5, uint: 6, uint32: 6, float: 7, float32: 7, double: 8, float64: 8,
};
const GLTF_TYPES = { 5120: 1, 5121: 2, 5122: 3, 5123: 4, 5125: 6, 5126: 7 };
const GLTF_SIZES = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };

/** The mesh in a file, fitted into the unit sphere; throws an EngineError that says what is wrong. */
export function parse(buffer, name) {
  let mesh;
  try {
    const kind = text(buffer, 0, 4);
    if (kind === "glTF") mesh = glb(buffer);
    else if (kind.startsWith("ply")) mesh = ply(buffer);
    else throw new EngineError("it is neither GLB nor PLY: export it as one of them");
  } catch (error) {
    const reason = error instanceof EngineError ? error.message : "it is damaged or cut short";
    throw new EngineError(`${name} cannot be shown: ${reason}.`);
  }
  const { positions, indices } = mesh;
  const wrong =
    !indices.length ||
    indices.some((index) => 3 * index >= positions.length) ||
    positions.some((value) => !Number.isFinite(value));
  if (wrong) {
    throw new EngineError(`${name} cannot be shown: it has no triangles, or damaged ones.`);
  }
  return fitted(mesh);
}

function glb(buffer) {
  const view = new DataView(buffer);
  const jsonLength = view.getUint32(12, true);
  const document = JSON.parse(text(buffer, 20, jsonLength));
  const first = 20 + jsonLength + 8;
  const used = document.extensionsRequired ?? [];
  if (used.length) throw new EngineError(`it needs ${used.join(", ")}: export it without`);
  const parts = [];
  const visit = (index, parent) => {
    const node = document.nodes[index];
    const matrix = product(parent, transform(node));
    for (const primitive of document.meshes?.[node.mesh]?.primitives ?? []) {
      if ((primitive.mode ?? 4) !== 4) continue;
      const positions = accessor(document, view, first, primitive.attributes.POSITION);
      const indices =
        primitive.indices === undefined
          ? Array.from({ length: positions.length / 3 }, (_, at) => at)
          : accessor(document, view, first, primitive.indices);
      const moved = mapped(positions, matrix, 1);
      const smooth = withNormals(moved, indices);
      if (primitive.attributes.NORMAL !== undefined) {
        const normals = accessor(document, view, first, primitive.attributes.NORMAL);
        smooth.normals = turned(normals, matrix);
      }
      if (determinant(matrix) < 0) smooth.normals = smooth.normals.map((value) => -value); // mirrored
      parts.push(smooth);
    }
    for (const child of node.children ?? []) visit(child, matrix);
  };
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  for (const index of document.scenes?.[document.scene ?? 0]?.nodes ?? []) visit(index, identity);
  return joined(parts);
}

function accessor(document, view, first, index) {
  const { bufferView, byteOffset = 0, componentType, count, type, sparse } = document.accessors[index];
  if (sparse || bufferView === undefined) throw new EngineError("it has sparse data: export it plain");
  const { byteOffset: start = 0, byteStride, buffer } = document.bufferViews[bufferView];
  if (buffer !== 0 || document.buffers[0].uri !== undefined) {
    throw new EngineError("its data are in another file: export it as one GLB");
  }
  const [read, bytes] = READERS[GLTF_TYPES[componentType]];
  const size = GLTF_SIZES[type];
  if (count * size > MOST) throw new EngineError("it has more than a million vertices: reduce it");
  const stride = byteStride ?? bytes * size;
  const out = new Float64Array(count * size);
  for (let item = 0; item < count; item++) {
    for (let part = 0; part < size; part++) {
      const at = first + start + byteOffset + item * stride + part * bytes;
      out[item * size + part] = view[read](at, true);
    }
  }
  return out;
}

function transform({ matrix, translation: t = [0, 0, 0], rotation: q = [0, 0, 0, 1], scale: s = [1, 1, 1] }) {
  if (matrix) return matrix;
  const [x, y, z, w] = q;
  return [
    (1 - 2 * (y * y + z * z)) * s[0], 2 * (x * y + z * w) * s[0], 2 * (x * z - y * w) * s[0], 0,
    2 * (x * y - z * w) * s[1], (1 - 2 * (x * x + z * z)) * s[1], 2 * (y * z + x * w) * s[1], 0,
    2 * (x * z + y * w) * s[2], 2 * (y * z - x * w) * s[2], (1 - 2 * (x * x + y * y)) * s[2], 0,
    ...t, 1,
  ];
}

/** The product of two 4×4 matrices, columns first. */
function product(a, b) {
  return Array.from({ length: 16 }, (_, at) => {
    const [row, column] = [at % 4, at - (at % 4)];
    return [0, 1, 2, 3].reduce((sum, k) => sum + a[row + 4 * k] * b[column + k], 0);
  });
}

function mapped(values, m, w) {
  const out = new Float32Array(values.length);
  for (let at = 0; at < values.length; at += 3) {
    for (let axis = 0; axis < 3; axis++) {
      out[at + axis] =
        m[axis] * values[at] + m[axis + 4] * values[at + 1] + m[axis + 8] * values[at + 2] +
        w * m[axis + 12];
    }
  }
  return out;
}

function determinant([a, b, c, , d, e, f, , g, h, i]) {
  return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
}

/** Normals turned by the cofactors of a matrix, which keep them upright under any scale. */
function turned(normals, m) {
  const c = (i, j) => {
    const [a, b] = [0, 1, 2].filter((row) => row !== i);
    const [d, e] = [0, 1, 2].filter((column) => column !== j);
    const minor = m[a + 4 * d] * m[b + 4 * e] - m[a + 4 * e] * m[b + 4 * d];
    return (i + j) % 2 ? -minor : minor;
  };
  const cofactors = [0, 1, 2].flatMap((j) => [c(0, j), c(1, j), c(2, j), 0]);
  const out = mapped(normals, [...cofactors, 0, 0, 0, 1], 0);
  for (let at = 0; at < out.length; at += 3) {
    const length = Math.hypot(out[at], out[at + 1], out[at + 2]) || 1;
    for (let axis = 0; axis < 3; axis++) out[at + axis] /= length;
  }
  return out;
}

function ply(buffer) {
  // A character a byte, so that places in the text are places in the file.
  const head = new TextDecoder("latin1").decode(new Uint8Array(buffer, 0, Math.min(buffer.byteLength, 65536)));
  const end = /end_header\r?\n/.exec(head);
  const format = /format (ascii|binary_little_endian|binary_big_endian)/.exec(head)?.[1];
  if (!end || !format) throw new EngineError("its header does not end");
  const elements = [];
  for (const line of head.slice(0, end.index).split(/\r?\n/)) {
    const words = line.trim().split(/\s+/);
    if (words[0] === "element") elements.push({ name: words[1], count: +words[2], properties: [] });
    if (words[0] === "property") elements.at(-1).properties.push(words.slice(1));
  }
  const start = end.index + end[0].length;
  const next = format === "ascii" ? asciiReader(buffer, start) : binaryReader(buffer, start, format);
  const positions = [];
  const normals = [];
  const indices = [];
  for (const { name, count, properties } of elements) {
    if (count > MOST) throw new EngineError("it has more than three million elements: reduce it");
    for (let item = 0; item < count; item++) {
      const row = {};
      for (const property of properties) {
        const [kind, ...types] = property;
        const length = kind === "list" ? next(PLY_TYPES[types[0]]) : 1;
        const type = PLY_TYPES[kind === "list" ? types[1] : kind];
        const values = Array.from({ length }, () => next(type));
        row[property.at(-1)] = kind === "list" ? values : values[0];
      }
      if (name === "vertex") {
        positions.push(row.x, row.y, row.z);
        if (row.nx !== undefined) normals.push(row.nx, row.ny, row.nz);
      }
      const corners = row.vertex_indices ?? row.vertex_index;
      for (let k = 2; name === "face" && k < (corners?.length ?? 0); k++) {
        indices.push(corners[0], corners[k - 1], corners[k]);
      }
    }
  }
  const mesh = withNormals(positions, indices);
  if (normals.length === positions.length) mesh.normals = Float32Array.from(normals);
  return mesh;
}

function binaryReader(buffer, start, format) {
  const view = new DataView(buffer);
  let at = start;
  return (type) => {
    const [read, bytes] = READERS[type];
    at += bytes;
    return view[read](at - bytes, format === "binary_little_endian");
  };
}

function asciiReader(buffer, start) {
  const words = text(buffer, start, buffer.byteLength - start).split(/\s+/);
  let at = words[0] === "" ? 1 : 0;
  return () => {
    if (at >= words.length) throw new RangeError("the text ends early");
    return Number(words[at++]);
  };
}

function text(buffer, first, length) {
  return new TextDecoder().decode(new Uint8Array(buffer, first, Math.min(length, buffer.byteLength - first)));
}
