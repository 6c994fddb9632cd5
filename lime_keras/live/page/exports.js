// What can be taken home: the numbers, and the material as glTF on a unit sphere.
// The factors are those of estimate/interchange.py, which the tests hold them to.

import { sphere } from "./shapes.js";

const LOBE_SHARE = 0.76;
const DIFFUSE_BELOW = 1.5;
const MOST_BRIGHT = 25;

/** glTF's numbers for {diffuse_albedo, specular_albedo, exponent}. */
export function gltfMaterial({ diffuse_albedo: diffuse, specular_albedo: specular, exponent }) {
  const wide = 1 / (1 + (exponent / DIFFUSE_BELOW) ** 2);
  const base = diffuse.map((value) => value + wide * specular);
  const lobe = (1 - wide) * LOBE_SHARE * specular;
  const scale = 1 / Math.max(Math.max(...base) + lobe, 1);
  const colour = base.map((value) => Math.min(Math.max((scale * value) / (1 - scale * lobe), 0), 1));
  return {
    name: "lime",
    pbrMetallicRoughness: {
      baseColorFactor: [...colour, 1],
      metallicFactor: 0,
      roughnessFactor: Math.sqrt(Math.min((2 / (exponent + 2)) ** 0.625, 0.6)),
    },
    extensions: {
      KHR_materials_specular: {
        specularFactor: scale * lobe,
        specularColorFactor: [MOST_BRIGHT, MOST_BRIGHT, MOST_BRIGHT],
      },
    },
    extras: { albedo_scale: scale },
  };
}

/** The text of a glTF 2.0 file with the material on a unit sphere. */
export function gltf(material, version) {
  const { positions, indices } = sphere();
  const bytes = new Uint8Array(positions.byteLength + 2 * indices.length);
  bytes.set(new Uint8Array(positions.buffer));
  bytes.set(new Uint8Array(Uint16Array.from(indices).buffer), positions.byteLength);
  let binary = "";
  for (const byte of bytes) binary += String.fromCharCode(byte);
  const document = {
    asset: { version: "2.0", generator: `lime_keras ${version}` },
    extensionsUsed: ["KHR_materials_specular"],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, name: "lime" }],
    meshes: [
      // On a unit sphere, positions are normals.
      { primitives: [{ attributes: { POSITION: 0, NORMAL: 0 }, indices: 1, material: 0 }] },
    ],
    materials: [gltfMaterial(material)],
    accessors: [
      {
        bufferView: 0,
        componentType: 5126,
        count: positions.length / 3,
        type: "VEC3",
        min: [-1, -1, -1],
        max: [1, 1, 1],
      },
      { bufferView: 1, componentType: 5123, count: indices.length, type: "SCALAR" },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: positions.byteLength, target: 34962 },
      { buffer: 0, byteOffset: positions.byteLength, byteLength: 2 * indices.length, target: 34963 },
    ],
    buffers: [
      {
        byteLength: bytes.length,
        uri: `data:application/octet-stream;base64,${btoa(binary)}`,
      },
    ],
  };
  return JSON.stringify(document, null, 1) + "\n";
}

/** Offer a Blob as a file. */
export function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
