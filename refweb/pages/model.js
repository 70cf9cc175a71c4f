// What is drawn: where everything is in a frame and how it is coloured. It reads what refweb/pages/space.py has written.
"use strict";

const part = (name) => document.getElementById(name);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const size = Math.hypot(...a) || 1; return a.map((x) => x / size); };
const TANGENT = Math.tan(Math.PI / 18); // of half the vertical angle of view

// What was written

async function unpacked(head, text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const raw = await new Response(stream).arrayBuffer();
  const kinds = { uint8: Uint8Array, uint32: Uint32Array, float32: Float32Array };
  const found = {};
  for (const [name, { type, start, length }] of Object.entries(head.arrays))
    found[name] = new kinds[type](raw, start, length);
  return found;
}

// Displacements of all frames [m]: changes of 16 bits from frame to frame, axis by axis, become sums of steps.
function displacements(head, arrays) {
  const points = arrays.origin.length / 3, entries = 3 * points;
  const level = new Uint16Array(entries), frames = [];
  for (let f = 0; f < head.numbers.length; f++) {
    const high = f * entries, low = (head.numbers.length + f) * entries, moved = new Float32Array(entries);
    for (let i = 0; i < entries; i++) level[i] += (arrays.moves[high + i] << 8) + arrays.moves[low + i];
    for (let axis = 0; axis < 3; axis++)
      for (let p = 0; p < points; p++)
        moved[3 * p + axis] = head.moves[axis][0] + head.moves[axis][1] * level[axis * points + p];
    frames.push(moved);
  }
  return frames;
}

// Corners of a surface with their normals, which are means over faces that meet at less than 40 degrees.
function shaded(points, triangles) {
  const at = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]], around = new Map(), normals = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => at(triangles[t + k]));
    normals.push(cross(minus(b, a), minus(c, a)));
    for (const corner of [a, b, c]) {
      const key = corner.map((x) => x.toPrecision(5)).join();
      if (!around.has(key)) around.set(key, []);
      around.get(key).push(normals.length - 1);
    }
  }
  const found = new Float32Array(6 * triangles.length);
  for (let i = 0; i < triangles.length; i++) {
    const corner = at(triangles[i]), own = unit(normals[Math.floor(i / 3)]), sum = [0, 0, 0];
    for (const face of around.get(corner.map((x) => x.toPrecision(5)).join()))
      if (dot(unit(normals[face]), own) > 0.766) normals[face].forEach((x, axis) => { sum[axis] += x; });
    found.set([...corner, ...unit(sum)], 6 * i);
  }
  return found;
}

class Model {
  constructor(head, arrays) {
    Object.assign(this, { head, arrays });
    this.moves = displacements(head, arrays);
    this.points = new Float32Array(arrays.origin.length);
    this.tints = new Uint8Array(2 * arrays.segments.length); // of each segment: colour, and its part of the thickness
    this.version = 0;
    this.bodies = head.bodies.map((body) => ({
      ...body, corners: shaded(arrays["points of body " + body.number], arrays["triangles of body " + body.number]),
    }));
  }

  // Where everything is in a frame, its displacements times a factor.
  move(frame, factor) {
    const { points, arrays: { origin } } = this, moved = this.moves[frame];
    for (let i = 0; i < points.length; i++) points[i] = origin[i] + factor * moved[i];
    for (const body of this.bodies) {
      body.turn = body.turns[frame];
      body.place = body.places[0].map((x, axis) => x + factor * (body.places[frame][axis] - x));
    }
    this.version++;
  }

  // Colours of a frame: the levels of a field between limits; slack lines grey where the field is theirs to be so; broken ones in
  // a colour of their own.
  paint(frame, field, low, high) {
    const { tints, head, arrays, head: { along, grey, broken, numbers }, arrays: { colours, slack } } = this;
    const lines = slack.length / numbers.length, levels = arrays[field.array], first = field.constant ? 0 : frame * lines;
    const [least, most] = field.ranges[frame], place = new Uint8Array(255);
    for (let i = 0; i < 255; i++) {
      const share = (least + (most - least) * i / 254 - low) / (high - low || 1);
      place[i] = Math.round(255 * Math.min(1, Math.max(0, share)));
    }
    const two = head.two.flat();
    for (let line = 0, t = 0; line < lines; line++) {
      const level = levels[first + line], torn = slack[frame * lines + line] === 2;
      const loose = torn || field.grey && slack[frame * lines + line] === 1;
      const value = least + (most - least) * level / 254;
      const [from, at] = torn ? [broken, 0] : field.two ? [two, value > 0.5 ? 3 : 0] : loose || level === 255 ? [grey, 0] : [colours, 3 * place[level]];
      for (let k = 0; k < along; k++, t += 4) {
        tints[t] = from[at];
        tints[t + 1] = from[at + 1];
        tints[t + 2] = from[at + 2];
        tints[t + 3] = loose ? 200 : 255;
      }
    }
    this.version++;
  }
}
