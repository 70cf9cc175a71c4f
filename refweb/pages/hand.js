// The model drawn by hand into the pixels of a canvas, with a buffer of depths: for browsers without WebGL, or with one
// that a processor plays, which takes longer for each line than this does.

class ByHand {
  constructor(context, model) {
    Object.assign(this, { context, model, seen: new Float32Array(model.points.length) });
    this.before = new Float32Array(model.points.length);
  }

  draw(camera, width, height, pixel, before) {
    const { model, model: { head, arrays: { origin, segments, supports } } } = this;
    if (this.image?.width !== width || this.image?.height !== height) {
      this.image = this.context.createImageData(width, height);
      this.pixels = new Uint32Array(this.image.data.buffer);
      this.depths = new Float32Array(width * height);
    }
    this.pixels.fill(0xffffffff);
    this.depths.fill(0);
    Object.assign(this, { width, height, axes: camera.axes.flat(), eye: camera.eye(), lens: camera.lens(width / height) });
    for (const body of model.bodies) this.surface(body);
    const thick = head.radius * height / (2 * this.lens[1]), least = 0.8 * pixel;
    this.project(model.points, this.seen);
    for (let s = 0, t = 0; s < segments.length; s += 2, t += 4) {
      const [r, g, b, part] = [model.tints[t], model.tints[t + 1], model.tints[t + 2], model.tints[t + 3]];
      this.line(this.seen, 3 * segments[s], 3 * segments[s + 1], r, g, b, thick * part / 255, least);
    }
    if (before) {
      this.project(origin, this.before);
      for (let s = 0; s < segments.length; s += 2)
        this.line(this.before, 3 * segments[s], 3 * segments[s + 1], 153, 153, 153, 0, 0.4 * pixel);
    }
    for (const p of supports) this.ball(3 * p, head.support, 2.2 * thick, 2.4 * least);
    this.context.putImageData(this.image, 0, 0);
  }

  // Points to pixels to the right and down, and the inverse of their distance; 0 of what is not in front of the eye.
  project(points, seen) {
    const [a, b, c, d, e, f, g, h, i] = this.axes, [x0, y0, z0] = this.eye, [across, up, near] = this.lens;
    const [w, h2] = [this.width / 2, this.height / 2];
    for (let p = 0; p < points.length; p += 3) {
      const x = points[p] - x0, y = points[p + 1] - y0, z = points[p + 2] - z0, far = -(g * x + h * y + i * z);
      const inverse = far > near ? 1 / far : 0;
      seen[p] = w * (1 + (a * x + b * y + c * z) * inverse / across);
      seen[p + 1] = h2 * (1 - (d * x + e * y + f * z) * inverse / up);
      seen[p + 2] = inverse;
    }
  }

  // A strip along the axis it is longer on, bright in the middle.
  line(seen, p, q, r, g, b, thick, least) {
    const { width, height, pixels, depths } = this;
    let x = seen[p], y = seen[p + 1], depth = seen[p + 2], x2 = seen[q], y2 = seen[q + 1], depth2 = seen[q + 2];
    if (depth === 0 || depth2 === 0) return;
    const steep = Math.abs(y2 - y) > Math.abs(x2 - x), most = steep ? height : width, other = steep ? width : height;
    const along = steep ? width : 1, beside = steep ? 1 : width;
    if (steep) [x, y, x2, y2] = [y, x, y2, x2];
    if (x > x2) [x, y, depth, x2, y2, depth2] = [x2, y2, depth2, x, y, depth];
    const size = x2 - x || 1, rise = (y2 - y) / size, fall = (depth2 - depth) / size;
    const half = Math.max(thick * (depth + depth2) / 2, least) * Math.sqrt(1 + rise * rise), scale = 1 / (half * half);
    const [first, last] = [Math.max(0, Math.ceil(x - 0.5)), Math.min(most - 1, Math.floor(x2 + 0.5))];
    for (let i = first; i <= last; i++) {
      const middle = y + rise * (i - x), near = depth + fall * (i - x);
      const low = Math.max(0, Math.ceil(middle - half)), high = Math.min(other - 1, Math.floor(middle + half));
      for (let j = low; j <= high; j++) {
        const place = i * along + j * beside;
        if (near < depths[place]) continue;
        depths[place] = near;
        const light = 1.08 - 0.5 * (j - middle) * (j - middle) * scale;
        const red = r * light, green = g * light, blue = b * light;
        pixels[place] = 0xff000000 | (blue > 255 ? 255 : blue) << 16 | (green > 255 ? 255 : green) << 8 | (red > 255 ? 255 : red);
      }
    }
  }

  ball(p, [r, g, b], thick, least) {
    const { width, height, pixels, depths, seen } = this, x = seen[p], y = seen[p + 1], depth = 1.0005 * seen[p + 2];
    const radius = Math.max(thick * depth, least);
    if (depth === 0 || x < -radius || y < -radius || x > width + radius || y > height + radius) return;
    for (let j = Math.max(0, Math.ceil(y - radius)); j <= Math.min(height - 1, y + radius); j++)
      for (let i = Math.max(0, Math.ceil(x - radius)); i <= Math.min(width - 1, x + radius); i++) {
        const far = ((i - x) ** 2 + (j - y) ** 2) / (radius * radius), place = j * width + i, light = 1.2 - 0.5 * far;
        if (far > 1 || depth < depths[place]) continue;
        depths[place] = depth;
        pixels[place] = 0xff000000 | b * light << 16 | g * light << 8 | r * light;
      }
  }

  // Triangles, the light of their corners between them.
  surface({ corners, turn, place, colour }) {
    const { width, height, pixels, depths, axes } = this, count = corners.length / 6;
    const points = new Float32Array(3 * count), seen = new Float32Array(3 * count), light = new Float32Array(count);
    const normal = [0, 0, 0];
    for (let k = 0; k < count; k++) {
      for (let axis = 0; axis < 3; axis++) {
        const [a, b, c] = [turn[3 * axis], turn[3 * axis + 1], turn[3 * axis + 2]], at = 6 * k;
        points[3 * k + axis] = place[axis] + a * corners[at] + b * corners[at + 1] + c * corners[at + 2];
        normal[axis] = a * corners[at + 3] + b * corners[at + 4] + c * corners[at + 5];
      }
      const [right, up, near] = [0, 3, 6].map((row) => axes[row] * normal[0] + axes[row + 1] * normal[1] + axes[row + 2] * normal[2]);
      light[k] = Math.abs(-0.34 * right + 0.54 * up + 0.77 * near);
    }
    this.project(points, seen);
    for (let k = 0; k < count; k += 3) {
      const [x, y, u, x1, y1, u1, x2, y2, u2] = seen.subarray(3 * k, 3 * k + 9);
      const area = (x1 - x) * (y2 - y) - (x2 - x) * (y1 - y);
      if (u * u1 * u2 === 0 || area === 0) continue;
      const left = Math.max(0, Math.ceil(Math.min(x, x1, x2))), right = Math.min(width - 1, Math.max(x, x1, x2));
      const top = Math.max(0, Math.ceil(Math.min(y, y1, y2))), bottom = Math.min(height - 1, Math.max(y, y1, y2));
      for (let j = top; j <= bottom; j++)
        for (let i = left; i <= right; i++) {
          const s = ((i - x) * (y2 - y) - (x2 - x) * (j - y)) / area, t = ((x1 - x) * (j - y) - (i - x) * (y1 - y)) / area;
          if (s < 0 || t < 0 || s + t > 1) continue;
          const depth = u + s * (u1 - u) + t * (u2 - u), at = j * width + i;
          if (depth < depths[at]) continue;
          depths[at] = depth;
          const shine = light[k] + s * (light[k + 1] - light[k]) + t * (light[k + 2] - light[k]);
          const gloss = 36 * shine ** 24, bright = 255 * (0.5 + 0.62 * shine);
          pixels[at] = 0xff000000 | Math.min(255, colour[2] * bright + gloss) << 16 |
            Math.min(255, colour[1] * bright + gloss) << 8 | Math.min(255, colour[0] * bright + gloss);
        }
    }
  }
}
