// A material with onnxruntime-web's WebAssembly: `npm install` in this folder, then
//
//     node onnx_web.mjs exported/lime.onnx photo.jpg
//
// The photo shows one object near its middle. In a browser, a canvas takes the place of sharp.
import * as ort from "onnxruntime-web";
import sharp from "sharp";

const [file, photo] = process.argv.slice(2);
const session = await ort.InferenceSession.create(file, { executionProviders: ["wasm"] });
const [, height, width] = session.inputMetadata[0].shape;
const upright = sharp(photo).rotate().toColourspace("srgb").removeAlpha();
const bytes = await upright.resize(width, height).raw().toBuffer(); // sRGB, 3 channels
const pixels = Float32Array.from(bytes, (value) => value / 255);
const image = new ort.Tensor("float32", pixels, [1, height, width, 3]);
const found = await session.run({ image });
// Eight bins from 1 to 1000, each 0.375 decades wide; a class stands for its bin's mean.
const log = (sum, probability, bin) => sum + probability * 0.375 * (bin + 0.5);
console.log(JSON.stringify({
  diffuse_albedo: [...found.diffuse_albedo.data],
  specular_albedo: found.specular_albedo.data[0],
  exponent: 10 ** found.exponent_bin_probabilities.data.reduce(log, 0),
  mask_coverage: found.mask.data.reduce((sum, value) => sum + value) / found.mask.data.length,
}));
