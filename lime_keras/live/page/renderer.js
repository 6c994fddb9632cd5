// The virtual object, shaded by Eq. 4 with the tables of D and S, in WebGL 2.

import { EngineError } from "./errors.js";

export const TABLE = 128;

const VERTEX = `#version 300 es
in vec3 position;
in vec3 normal;
uniform mat3 turn;
uniform vec2 scale;
out vec3 n;
void main() {
  n = turn * normal;
  vec3 p = turn * position;
  gl_Position = vec4(p.xy * scale, -0.5 * p.z, 1.0);
}`;

// A viewer far away sees orthographically, and sees no normal that is turned away: those that
// interpolation leaves at the rim, and the insides of open meshes, are mirrored.
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 n;
uniform sampler2D table;
uniform vec4 materials[2];
uniform float split;
out vec4 colour;
void main() {
  vec3 m = normalize(n);
  m.z = abs(m.z);
  vec4 shading = texture(table, 0.5 + 0.5 * m.xy / sqrt(1.0 + m.z));
  bool before = gl_FragCoord.x < split;
  vec2 ds = before ? shading.rg : shading.ba;
  vec4 material = before ? materials[0] : materials[1];
  vec3 linear = clamp(material.rgb * ds.x + material.a * ds.y, 0.0, 1.0);
  vec3 low = 12.92 * linear;
  vec3 high = 1.055 * pow(max(linear, 0.0031308), vec3(1.0 / 2.4)) - 0.055;
  colour = vec4(mix(low, high, step(0.0031308, linear)), 1.0);
}`;

/** The object on a canvas; it is drawn when `draw` is called. */
export class Renderer {
  constructor(canvas) {
    this.canvas = canvas;
    this.turn = rotation(0.5, 0.35);
    this.materials = [[0.5, 0.5, 0.5, 0.2], [0.5, 0.5, 0.5, 0.2]];
    this.split = 0;
    this.gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    if (!this.gl) {
      throw new EngineError(
        "This browser shows no 3D (WebGL 2 is off): turn hardware acceleration on in its settings, " +
          "or use a newer browser. The numbers work without it.",
      );
    }
    this.#prepare();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.#prepare();
      if (this.mesh) this.show(this.mesh);
      this.draw();
    });
  }

  #prepare() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new EngineError(`The 3D picture cannot be drawn: ${gl.getProgramInfoLog(program)}`);
    }
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    this.program = program;
    this.at = Object.fromEntries(
      ["turn", "scale", "materials", "split"].map((name) => [name, gl.getUniformLocation(program, name)]),
    );
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR],
      [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    this.light(this.texels ?? new Float32Array(4 * TABLE * TABLE));
  }

  /** Show a mesh {positions, normals, indices}. */
  show(mesh) {
    const { gl } = this;
    this.mesh = mesh;
    for (const buffer of this.buffers ?? []) gl.deleteBuffer(buffer);
    gl.deleteVertexArray(this.array ?? null);
    this.array = gl.createVertexArray();
    this.buffers = [0, 1, 2].map(() => gl.createBuffer());
    gl.bindVertexArray(this.array);
    for (const [at, name, values] of [[0, "position", mesh.positions], [1, "normal", mesh.normals]]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[at]);
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      const place = gl.getAttribLocation(this.program, name);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers[2]);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.indices, gl.STATIC_DRAW);
  }

  /** Take tables: D, S of the material before, D, S of the material now, for each texel. */
  light(texels) {
    this.texels = texels;
    // Half floats hold radiance up to 65504.
    const held = texels.map((value) => Math.min(value, 65504));
    const { gl } = this;
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, TABLE, TABLE, 0, gl.RGBA, gl.FLOAT, held);
  }

  /** Turn the object by angles in radians about the vertical and about the horizontal. */
  rotate(right, down) {
    this.turn = multiply(rotation(right, down), this.turn);
  }

  draw() {
    const { gl, canvas } = this;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (!this.mesh) return;
    const side = 0.97 * Math.min(width, height);
    gl.uniformMatrix3fv(this.at.turn, false, this.turn);
    gl.uniform2f(this.at.scale, side / width, side / height);
    gl.uniform4fv(this.at.materials, this.materials.flat());
    gl.uniform1f(this.at.split, this.split * width);
    gl.drawElements(gl.TRIANGLES, this.mesh.indices.length, gl.UNSIGNED_INT, 0);
  }

  /** A PNG of the object on a transparent ground. */
  async picture() {
    this.draw();
    return new Promise((resolve) => this.canvas.toBlob(resolve, "image/png"));
  }
}

/** The rotation by `right` about the vertical, then by `down` about the horizontal, columns first. */
function rotation(right, down) {
  const [c, s, d, t] = [Math.cos(right), Math.sin(right), Math.cos(down), Math.sin(down)];
  return [c, -t * -s, d * -s, 0, d, t, s, -t * c, d * c];
}

function multiply(a, b) {
  return Array.from({ length: 9 }, (_, at) => {
    const [row, column] = [at % 3, at - (at % 3)];
    return a[row] * b[column] + a[row + 3] * b[column + 1] + a[row + 6] * b[column + 2];
  });
}
