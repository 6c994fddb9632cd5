// The virtual objects: {positions, normals, indices}, outside anticlockwise, y up, within the unit
// sphere.

/** The unit sphere. */
export function sphere() {
  const turns = Array.from({ length: 65 }, (_, step) => (Math.PI * step) / 64);
  const ball = lathe(turns.map((angle) => [Math.sin(angle), -Math.cos(angle)]));
  return { ...ball, normals: ball.positions };
}

/** A pot with a lid, a spout and a handle, in the manner of the famous one. */
export function teapot() {
  const body = [
    [0, -0.62], [0.3, -0.62], [0.46, -0.6], [0.5, -0.56], [0.52, -0.52], [0.62, -0.4],
    [0.7, -0.22], [0.72, -0.04], [0.68, 0.14], [0.6, 0.28], [0.52, 0.37], [0.5, 0.41],
    [0.47, 0.42], [0.44, 0.4], [0.38, 0.44], [0.26, 0.48], [0.14, 0.51], [0.07, 0.54],
    [0.06, 0.57], [0.1, 0.62], [0.11, 0.67], [0.08, 0.71], [0, 0.73],
  ];
  const spout = [
    [0.56, -0.3], [0.76, -0.27], [0.9, -0.1], [0.97, 0.12], [1.05, 0.28], [1.16, 0.36],
  ];
  const handle = [
    [-0.6, 0.24], [-0.8, 0.3], [-1.0, 0.26], [-1.08, 0.06], [-1.0, -0.16], [-0.8, -0.3],
    [-0.62, -0.34],
  ];
  return fitted(
    joined([
      lathe(smooth(body, 6)),
      tube(smooth(spout, 8), (share) => 0.17 - 0.09 * share ** 0.8),
      tube(smooth(handle, 8), () => 0.065),
    ]),
  );
}

/** A knot: grazing angles and every normal at once. */
export function knot() {
  const count = 360;
  const path = Array.from({ length: count + 1 }, (_, step) => {
    const t = (2 * Math.PI * step) / count;
    const r = 0.58 * (1 + 0.42 * Math.cos(3 * t));
    return [r * Math.cos(2 * t), r * Math.sin(2 * t), 0.32 * Math.sin(3 * t)];
  });
  return fitted(tube(path, () => 0.185));
}

/** A profile [radius, height], from below, turned about the vertical. */
export function lathe(profile) {
  const columns = 96;
  const positions = [];
  for (const [radius, height] of profile) {
    for (let column = 0; column <= columns; column++) {
      const angle = (2 * Math.PI * column) / columns;
      positions.push(radius * Math.sin(angle), height, radius * Math.cos(angle));
    }
  }
  return withNormals(positions, grid(profile.length, columns + 1), seam(profile.length, columns));
}

/** A tube of radius `radius(share of its length)` about a path of points [x, y] or [x, y, z]. */
export function tube(path, radius) {
  const columns = 32;
  const positions = [];
  let across = [0, 0, 1];
  path.forEach((point, index) => {
    const [before, after] = [path[Math.max(index - 1, 0)], path[Math.min(index + 1, path.length - 1)]];
    const along = unit([after[0] - before[0], after[1] - before[1], (after[2] ?? 0) - (before[2] ?? 0)]);
    // The frame is carried along the path, so that the tube is not twisted.
    const tilt = dot(across, along);
    across = unit(across.map((value, axis) => value - tilt * along[axis]));
    const third = cross(along, across);
    const wide = radius(index / (path.length - 1));
    for (let column = 0; column <= columns; column++) {
      const angle = (2 * Math.PI * column) / columns;
      for (let axis = 0; axis < 3; axis++) {
        const ring = Math.cos(angle) * across[axis] + Math.sin(angle) * third[axis];
        positions.push((point[axis] ?? 0) + wide * ring);
      }
    }
  });
  return withNormals(positions, grid(path.length, columns + 1), seam(path.length, columns));
}

/** Positions and triangles with smooth normals; pairs in `same` are one vertex, cut at a seam. */
export function withNormals(positions, indices, same = []) {
  const points = Float32Array.from(positions);
  const normals = new Float32Array(points.length);
  for (let at = 0; at < indices.length; at += 3) {
    const [a, b, c] = [0, 1, 2].map((corner) => 3 * indices[at + corner]);
    const [u, v] = [b, c].map((p) => [0, 1, 2].map((axis) => points[p + axis] - points[a + axis]));
    const area = cross(u, v); // as long as the triangle is large
    for (const p of [a, b, c]) for (let axis = 0; axis < 3; axis++) normals[p + axis] += area[axis];
  }
  for (const [one, other] of same) {
    for (let axis = 0; axis < 3; axis++) {
      const sum = normals[3 * one + axis] + normals[3 * other + axis];
      normals[3 * one + axis] = normals[3 * other + axis] = sum;
    }
  }
  for (let at = 0; at < normals.length; at += 3) {
    const length = Math.hypot(normals[at], normals[at + 1], normals[at + 2]);
    // A vertex of no area, as at a pole, takes the direction from the middle.
    const from = length > 1e-12 ? normals : points;
    const by = length > 1e-12 ? length : Math.hypot(points[at], points[at + 1], points[at + 2]) || 1;
    for (let axis = 0; axis < 3; axis++) normals[at + axis] = from[at + axis] / by;
  }
  return { positions: points, normals, indices: Uint32Array.from(indices) };
}

/** A mesh moved and scaled into the unit sphere. */
export function fitted(mesh) {
  const low = [Infinity, Infinity, Infinity];
  const high = low.map((value) => -value);
  const { positions } = mesh;
  for (let at = 0; at < positions.length; at++) {
    low[at % 3] = Math.min(low[at % 3], positions[at]);
    high[at % 3] = Math.max(high[at % 3], positions[at]);
  }
  const middle = low.map((value, axis) => (value + high[axis]) / 2);
  let radius = 0;
  for (let at = 0; at < positions.length; at += 3) {
    const offset = middle.map((value, axis) => positions[at + axis] - value);
    radius = Math.max(radius, Math.hypot(...offset));
  }
  const moved = positions.map((value, at) => (value - middle[at % 3]) / (radius || 1));
  return { ...mesh, positions: moved };
}

/** Several meshes as one. */
export function joined(meshes) {
  const positions = [];
  const normals = [];
  const indices = [];
  for (const mesh of meshes) {
    const first = positions.length / 3;
    for (const value of mesh.positions) positions.push(value);
    for (const value of mesh.normals) normals.push(value);
    for (const value of mesh.indices) indices.push(first + value);
  }
  return {
    positions: Float32Array.from(positions),
    normals: Float32Array.from(normals),
    indices: Uint32Array.from(indices),
  };
}

/** Triangles of a grid of vertices, row by row. */
function grid(rows, columns) {
  const out = [];
  for (let row = 0; row + 1 < rows; row++) {
    for (let column = 0; column + 1 < columns; column++) {
      const a = row * columns + column;
      out.push(a, a + 1, a + columns, a + 1, a + columns + 1, a + columns);
    }
  }
  return out;
}

function seam(rows, columns) {
  return Array.from({ length: rows }, (_, row) => [row * (columns + 1), row * (columns + 1) + columns]);
}

/** Points of a smooth curve through given points (Catmull–Rom), `steps` to each gap. */
function smooth(points, steps) {
  const out = [];
  const at = (index) => points[Math.min(Math.max(index, 0), points.length - 1)];
  for (let index = 0; index + 1 < points.length; index++) {
    for (let step = 0; step < steps; step++) {
      const t = step / steps;
      out.push(
        [0, 1].map((axis) => {
          const [a, b, c, d] = [-1, 0, 1, 2].map((offset) => at(index + offset)[axis]);
          const curve = 2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t;
          return Math.max((curve + (3 * b - a - 3 * c + d) * t ** 3) / 2, axis === 0 && b === 0 ? 0 : -9);
        }),
      );
    }
  }
  out.push(points[points.length - 1]);
  return out;
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const unit = (a) => a.map((value) => value / (Math.hypot(...a) || 1));
