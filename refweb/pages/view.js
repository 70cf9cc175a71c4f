// The page: an eye that turns, moves and comes nearer, and the controls.

// The eye looks along the third axis at a target, from a distance.
class Camera {
  constructor(head) {
    this.head = head;
    this.size = Math.hypot(...minus(head.box[1], head.box[0])) || 1;
  }

  // The first view: all of the box, as near as that goes.
  reset(aspect) {
    const [low, high] = this.head.box, at = (bits) => [0, 1, 2].map((axis) => (bits >> axis & 1 ? high : low)[axis]);
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => this.head.axes.map((axis) => dot(axis, at(bits))));
    this.axes = this.head.axes.map((axis) => [...axis]);
    const middle = [], far = [];
    [TANGENT * aspect, TANGENT].forEach((tangent, k) => {
      const t = tangent / 1.06, below = Math.max(...corners.map((c) => t * c[2] - c[k]));
      const above = Math.max(...corners.map((c) => t * c[2] + c[k]));
      middle.push((above - below) / 2);
      far.push((above + below) / (2 * t));
    });
    const depth = (Math.min(...corners.map((c) => c[2])) + Math.max(...corners.map((c) => c[2]))) / 2;
    this.distance = Math.max(...far) - depth;
    this.first = this.distance;
    this.target = [0, 1, 2].map((x) => middle[0] * this.axes[0][x] + middle[1] * this.axes[1][x] + depth * this.axes[2][x]);
  }

  eye() { return this.target.map((x, axis) => x + this.distance * this.axes[2][axis]); }

  lens(aspect) {
    return [TANGENT * aspect, TANGENT, Math.max(0.02 * this.distance, this.distance - 3 * this.size), this.distance + 6 * this.size];
  }

  // Turn about the axes of the screen, by angles to the right and down.
  turn(right, down) {
    const [x, y, z] = this.axes, mixed = (a, b, angle) => a.map((value, i) => Math.cos(angle) * value + Math.sin(angle) * b[i]);
    const near = mixed(z, x, -right), side = unit(mixed(x, z, right));
    this.axes = [side, unit(mixed(y, near, -down)), unit(mixed(near, y, down))];
  }

  // Move by shares of the height of the picture.
  pan(right, up) {
    const size = 2 * TANGENT * this.distance;
    this.target = this.target.map((x, i) => x - size * (right * this.axes[0][i] + up * this.axes[1][i]));
  }

  zoom(factor) {
    this.distance = Math.min(20 * this.first, Math.max(0.01 * this.first, this.distance / factor));
  }
}

// The controls

class View {
  constructor(model, painter, canvas) {
    const { head } = model;
    Object.assign(this, { head, model, painter, canvas, frame: 0, swing: 1, quality: Math.min(2, devicePixelRatio || 1) });
    this.camera = new Camera(head);
    this.slider = part("frame");
    this.slider.max = head.numbers.length - 1;
    head.fields.forEach((field, i) => part("field").add(new Option(field.name.replaceAll("_", " "), i)));
    this.listen();
    this.reset();
    this.show(head.peak);
    new ResizeObserver(() => this.redraw()).observe(canvas);
  }

  aspect() { return this.canvas.clientWidth / (this.canvas.clientHeight || 1); }

  reset() {
    this.camera.reset(this.aspect());
    this.redraw();
  }

  show(frame) {
    const count = this.head.numbers.length;
    this.frame = Math.min(count - 1, Math.max(0, frame));
    this.slider.value = this.frame;
    part("time").textContent = this.head.labels[this.frame];
    this.slider.setAttribute("aria-valuetext", this.head.labels[this.frame]);
    this.changed = true;
    this.redraw();
  }

  field() { return this.head.fields[part("field").selectedIndex]; }

  // The range of the colours: that of taut lines, from 0 where this does not waste half of it.
  limits(field) {
    const known = (part("own").checked ? [field.taut[this.frame]] : field.taut).filter((range) => range);
    let low = known.length ? Math.min(...known.map((range) => range[0])) : 0;
    const high = known.length ? Math.max(...known.map((range) => range[1])) : 1;
    if (low >= 0 && low <= 0.5 * high) low = 0;
    return high - low > 1e-9 * Math.abs(high) ? [low, high] : [Math.min(0, high), Math.max(0, high) || 1];
  }

  // Colours of the bar from left to right: of values, or of the two that there are.
  shades(field) {
    const { head, arrays: { colours } } = this.model, css = (rgb) => `rgb(${rgb.join()})`;
    if (field.two) return [`${css(head.two[0])} 50%`, `${css(head.two[1])} 50%`];
    return [0, 32, 64, 96, 128, 160, 192, 224, 255].map((i) => css([...colours.subarray(3 * i, 3 * i + 3)]));
  }

  // The colour bar and what stands beside it.
  legend(field, low, high) {
    const text = (value) => String(Number((value * field.factor).toPrecision(3)));
    const ticks = field.two ? ["taut", "slack"] : [0, 1, 2, 3, 4].map((i) => text(low + (high - low) * i / 4));
    part("scale").textContent = field.name.replaceAll("_", " ") + (field.shown ? ` [${field.shown}]` : "");
    part("ticks").replaceChildren(...ticks.map((tick) => Object.assign(document.createElement("span"), { textContent: tick })));
    part("slack").hidden = !field.grey;
    part("bar").style.background = `linear-gradient(to right, ${this.shades(field).join()})`;
    const all = part("own").checked ? "range of this frame" : "one range for all frames";
    part("bar").setAttribute("aria-label", `Colours of ${field.name}: from ${ticks[0]} to ${ticks.at(-1)} ${field.shown}, ${all}`);
  }

  // Draw with the next picture of the screen, sharper once nothing moves any more.
  redraw() {
    clearTimeout(this.rest);
    this.still = false;
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((now) => {
      this.waiting = false;
      const passed = now - (this.last ?? 0);
      if (passed < 100) this.slow = 0.8 * (this.slow ?? 16) + 0.2 * passed;
      if (this.slow > 24) [this.quality, this.slow] = [Math.max(0.5, 0.8 * this.quality), 16];
      this.last = now;
      this.draw(this.quality);
      this.rest = setTimeout(() => {
        this.draw(Math.max(2, devicePixelRatio || 1));
        this.still = true;
      }, 180);
    });
  }

  draw(sharpness) {
    const { canvas, model, painter } = this, area = canvas.clientWidth * canvas.clientHeight;
    if (!area) return;
    const pixel = Math.min(sharpness, Math.sqrt(6e6 / area));
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((size) => Math.max(1, Math.round(size * pixel)));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    if (this.changed) {
      const field = this.field(), [low, high] = this.limits(field);
      model.move(this.frame, Number(part("factor").value) * this.swing);
      model.paint(this.frame, field, low, high);
      this.legend(field, low, high);
      this.changed = false;
    }
    painter.draw(this.camera, width, height, pixel, part("before").checked);
  }

  // Play: a mode swings, a run goes on as its times do, load steps follow each other.
  play(on) {
    this.playing = on;
    part("play").textContent = on ? "Pause" : "Play";
    const { times, kind } = this.head, count = times.length, long = 1000 * Math.min(12, Math.max(2.5, count / 12));
    const share = times.map((t, i) => (kind === "static" ? i : t - times[0]) / ((kind === "static" ? count - 1 : times.at(-1) - times[0]) || 1));
    let began = performance.now() - (kind === "modes" || this.frame === count - 1 ? 0 : share[this.frame] * long);
    const step = (now) => {
      if (this.playing !== on || !on) return;
      const passed = Math.max(0, now - began);
      if (kind === "modes") {
        this.swing = Math.cos(passed / 300);
        this.changed = true;
        this.redraw();
      } else {
        if (passed > long + 700) began = now;
        const next = share.findLastIndex((s) => s * long <= passed);
        if (next !== this.frame) this.show(next);
      }
      requestAnimationFrame(step);
    };
    if (on) requestAnimationFrame(step);
    else if (this.swing !== 1) [this.swing, this.changed] = [1, true];
    this.redraw();
  }

  listen() {
    const { canvas, camera } = this, pointers = new Map();
    const again = () => { this.changed = true; this.redraw(); };
    for (const name of ["field", "own", "factor", "before"]) part(name).addEventListener("input", again);
    this.slider.addEventListener("input", () => this.show(Number(this.slider.value)));
    part("play").addEventListener("click", () => this.play(!this.playing));
    part("reset").addEventListener("click", () => this.reset());
    const middle = () => [0, 1].map((k) => [...pointers.values()].reduce((sum, p) => sum + p[k] / pointers.size, 0));
    const spread = () => { const [a, b] = pointers.values(); return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0; };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!pointers.has(event.pointerId)) return;
      const [before, apart] = [middle(), spread()];
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      const now = middle(), shift = [now[0] - before[0], now[1] - before[1]], height = canvas.clientHeight;
      if (pointers.size > 1 || event.shiftKey || event.buttons === 2 || event.buttons === 4)
        camera.pan(shift[0] / height, -shift[1] / height);
      else camera.turn(shift[0] * 3.5 / height, shift[1] * 3.5 / height);
      if (pointers.size > 1 && apart > 0) camera.zoom(spread() / apart);
      this.redraw();
    });
    for (const name of ["pointerup", "pointercancel"])
      canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      camera.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
      this.redraw();
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const key = event.shiftKey ? "Shift " + event.key : event.key, angle = Math.PI / 24;
      const does = {
        " ": () => this.play(!this.playing),
        ArrowRight: () => this.show(this.frame + 1), ArrowLeft: () => this.show(this.frame - 1),
        ArrowUp: () => camera.zoom(1.1), ArrowDown: () => camera.zoom(1 / 1.1),
        Home: () => this.show(0), End: () => this.show(this.head.numbers.length - 1),
        "Shift ArrowRight": () => camera.turn(angle, 0), "Shift ArrowLeft": () => camera.turn(-angle, 0),
        "Shift ArrowUp": () => camera.turn(0, -angle), "Shift ArrowDown": () => camera.turn(0, angle),
        r: () => this.reset(),
      }[key];
      if (!does) return;
      event.preventDefault();
      does();
      this.redraw();
    });
  }
}

// WebGL where there is hardware for it, which is faster; without, drawing by hand is.
function painterOf(model, canvas) {
  const wanted = new URLSearchParams(location.search).get("draw");
  const trial = wanted === "hand" ? null : document.createElement("canvas").getContext("webgl2");
  const named = trial?.getExtension("WEBGL_debug_renderer_info");
  const by = trial ? String(trial.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : trial.RENDERER)) : "";
  trial?.getExtension("WEBGL_lose_context")?.loseContext();
  if (trial && (wanted === "webgl" || !/swiftshader|llvmpipe|softpipe|software|basic render/i.test(by))) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, preserveDrawingBuffer: true });
    if (gl) return new ByWebGL(gl, model);
  }
  part("by").hidden = false;
  return new ByHand(canvas.getContext("2d", { alpha: false }), model);
}

async function begin() {
  const fail = () => {
    part("view").classList.add("still");
    part("without").hidden = false;
  };
  if (typeof DecompressionStream === "undefined") return fail();
  const head = JSON.parse(part("head").textContent);
  const arrays = await unpacked(head, part("data").textContent.trim());
  const model = new Model(head, arrays), canvas = part("canvas");
  window.refweb = new View(model, painterOf(model, canvas), canvas);
}

if (part("view")) begin();
