// The model drawn by WebGL 2. Lines are strips that face the eye and are shaded as tubes; supports are balls.

const CAMERA = `#version 300 es
uniform mat3 axes; uniform vec3 eye; uniform vec4 lens; // tangents of half the angles, near, far
vec3 seen(vec3 x) { return axes * (x - eye); }
vec4 onScreen(vec3 p) {
  float n = lens.z, f = lens.w;
  return vec4(p.xy / lens.xy, (p.z * (f + n) + 2.0 * f * n) / (n - f), -p.z);
}
`;
const LINES = [CAMERA + `
in vec2 corner; in vec3 a, b; in vec4 tint;
uniform vec2 half_size; uniform vec2 width; // pixels; radius [m] and least half width [pixel]
out vec3 colour; out float across;
void main() {
  vec3 p = seen(a), q = seen(b);
  float near = -1.01 * lens.z;
  if (p.z > near && q.z < near) p = mix(p, q, (p.z - near) / (p.z - q.z));
  if (q.z > near && p.z < near) q = mix(q, p, (q.z - near) / (q.z - p.z));
  vec2 s = p.xy / (-p.z * lens.xy) * half_size, t = q.xy / (-q.z * lens.xy) * half_size, d = t - s;
  float size = length(d);
  d = size > 1e-4 ? d / size : vec2(1.0, 0.0);
  vec3 here = corner.x < 0.5 ? p : q;
  float w = max(tint.a * width.x * half_size.y / (-here.z * lens.y), width.y);
  vec2 shift = corner.y * w * vec2(-d.y, d.x) + (corner.x - 0.5) * w * d;
  gl_Position = onScreen(here);
  gl_Position.xy += shift / half_size * gl_Position.w;
  colour = tint.rgb;
  across = corner.y;
}`, `#version 300 es
precision mediump float;
in vec3 colour; in float across; out vec4 shown;
void main() { shown = vec4(colour * (1.08 - 0.5 * across * across), 1.0); }`];
const THIN = [CAMERA + `
in vec3 a;
void main() { gl_Position = onScreen(seen(a)); }`, `#version 300 es
precision mediump float;
out vec4 shown;
void main() { shown = vec4(0.6, 0.6, 0.6, 1.0); }`];
const BALLS = [CAMERA + `
in vec3 a;
uniform vec2 half_size; uniform vec2 width;
void main() {
  vec3 p = seen(a);
  gl_Position = onScreen(p);
  gl_PointSize = 2.0 * max(2.2 * width.x * half_size.y / (-p.z * lens.y), 2.4 * width.y);
}`, `#version 300 es
precision mediump float;
uniform vec3 paint;
out vec4 shown;
void main() {
  vec2 p = 2.0 * gl_PointCoord - 1.0;
  if (dot(p, p) > 1.0) discard;
  shown = vec4(paint * (1.2 - 0.5 * dot(p, p)), 1.0);
}`];
const SURFACE = [CAMERA + `
in vec3 a, normal;
uniform mat3 turn; uniform vec3 place;
out vec3 n;
void main() { n = axes * (turn * normal); gl_Position = onScreen(seen(turn * a + place)); }`, `#version 300 es
precision mediump float;
in vec3 n;
uniform vec3 paint;
out vec4 shown;
void main() {
  float light = abs(dot(normalize(n), vec3(-0.34, 0.54, 0.77)));
  shown = vec4(paint * (0.5 + 0.62 * light) + 0.14 * pow(light, 24.0), 1.0);
}`];

function program(gl, [vertex, fragment]) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return new Proxy({}, { get: (known, name) => {
    if (name === "use") return () => gl.useProgram(made);
    if (name === "attribute") return (of) => gl.getAttribLocation(made, of);
    return known[name] ??= gl.getUniformLocation(made, name);
  } });
}

class ByWebGL {
  constructor(gl, model) {
    const { arrays } = model;
    Object.assign(this, { gl, model });
    this.lines = program(gl, LINES);
    this.thin = program(gl, THIN);
    this.balls = program(gl, BALLS);
    this.surface = program(gl, SURFACE);
    this.ends = new Float32Array(3 * arrays.segments.length);
    this.held = new Float32Array(3 * arrays.supports.length);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.clearColor(1, 1, 1, 1);
    this.endBuffer = gl.createBuffer();
    this.tintBuffer = gl.createBuffer();
    this.heldBuffer = gl.createBuffer();
    this.strips = this.array(this.lines, [
      ["corner", 2, gl.FLOAT, this.filled(new Float32Array([0, -1, 0, 1, 1, -1, 1, 1])), 0, 0, 0],
      ["a", 3, gl.FLOAT, this.endBuffer, 24, 0, 1], ["b", 3, gl.FLOAT, this.endBuffer, 24, 12, 1],
      ["tint", 4, gl.UNSIGNED_BYTE, this.tintBuffer, 4, 0, 1]]);
    this.before = this.array(this.thin, [["a", 3, gl.FLOAT, this.filled(arrays.origin), 12, 0, 0]]);
    gl.bindVertexArray(this.before);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, arrays.segments, gl.STATIC_DRAW);
    this.marks = this.array(this.balls, [["a", 3, gl.FLOAT, this.heldBuffer, 12, 0, 0]]);
    this.bodies = model.bodies.map((body) => {
      const buffer = this.filled(body.corners);
      return this.array(this.surface,
        [["a", 3, gl.FLOAT, buffer, 24, 0, 0], ["normal", 3, gl.FLOAT, buffer, 24, 12, 0]]);
    });
  }

  filled(data) {
    const { gl } = this, buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return buffer;
  }

  array(using, attributes) {
    const { gl } = this, made = gl.createVertexArray();
    gl.bindVertexArray(made);
    for (const [name, size, type, buffer, stride, offset, divisor] of attributes) {
      const place = using.attribute(name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, type === gl.UNSIGNED_BYTE, stride, offset);
      gl.vertexAttribDivisor(place, divisor);
    }
    gl.bindVertexArray(null);
    return made;
  }

  update(buffer, data) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.DYNAMIC_DRAW);
  }

  // Take over where the model is, and its colours.
  upload() {
    const { ends, held, model: { points, tints, version, arrays: { segments, supports } } } = this;
    for (let i = 0, e = 0; i < segments.length; i++) {
      const p = 3 * segments[i];
      ends[e++] = points[p];
      ends[e++] = points[p + 1];
      ends[e++] = points[p + 2];
    }
    supports.forEach((p, i) => held.set(points.subarray(3 * p, 3 * p + 3), 3 * i));
    this.update(this.endBuffer, ends);
    this.update(this.heldBuffer, held);
    this.update(this.tintBuffer, tints);
    this.version = version;
  }


  draw(camera, width, height, pixel, before) {
    const { gl, model, model: { head, arrays } } = this, lens = camera.lens(width / height);
    if (this.version !== model.version) this.upload();
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const ready = (using, paint) => {
      using.use();
      gl.uniformMatrix3fv(using.axes, true, camera.axes.flat());
      gl.uniform3fv(using.eye, camera.eye());
      gl.uniform4fv(using.lens, lens);
      gl.uniform2f(using.half_size, width / 2, height / 2);
      gl.uniform2f(using.width, head.radius, 0.8 * pixel);
      if (paint) gl.uniform3fv(using.paint, paint);
    };
    for (const [i, body] of model.bodies.entries()) {
      ready(this.surface, body.colour);
      gl.uniformMatrix3fv(this.surface.turn, true, body.turn);
      gl.uniform3fv(this.surface.place, body.place);
      gl.bindVertexArray(this.bodies[i]);
      gl.drawArrays(gl.TRIANGLES, 0, body.corners.length / 6);
    }
    ready(this.lines);
    gl.bindVertexArray(this.strips);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, model.tints.length / 4);
    if (before) {
      ready(this.thin);
      gl.bindVertexArray(this.before);
      gl.drawElements(gl.LINES, arrays.segments.length, gl.UNSIGNED_INT, 0);
    }
    if (this.held.length) {
      ready(this.balls, head.support.map((x) => x / 255));
      gl.bindVertexArray(this.marks);
      gl.drawArrays(gl.POINTS, 0, this.held.length / 3);
    }
    gl.bindVertexArray(null);
  }
}

