// The image of the scene, with pointer and keyboard input: orbit, pan, zoom, select, pull.

const CLICK = 4; // largest pointer motion of a click, in CSS pixels

class Stage {
  constructor(canvas, send) {
    this.canvas = canvas;
    this.send = send;
    this.moved = null;
    this.hands = new Map();
    this.pressed = null; // position of a press that may become a click
    this.pulling = null; // id of the pointer that pulls a body
    this.pulled = null; // target of the pull, until it is sent
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
      if (event.button === 0 && (event.ctrlKey || event.metaKey) && this.hands.size === 0) {
        this.pulling = event.pointerId;
        canvas.dataset.pulls = "";
        this.send({ do: "grab", ...this.place(event) });
        return;
      }
      this.pressed = event.button === 0 && !event.shiftKey && this.hands.size === 0 ? [event.clientX, event.clientY] : null;
      this.hands.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => {
        this.hands.delete(event.pointerId);
        if (this.pulling === event.pointerId) {
          this.pulling = null;
          this.pulled = null;
          delete canvas.dataset.pulls;
          this.send({ do: "release" });
        } else if (this.pressed !== null) {
          if (end === "pointerup") this.send({ do: "select", ...this.place(event) });
          this.pressed = null;
        }
      });
    }
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 16 : 1;
      this.move("zoom", 0, Math.max(-4, Math.min(4, -event.deltaY * lines / 100)));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.size()).observe(canvas);
  }

  /** Position in fractions of the image's width and height, clamped to the image if `inside` is true. */
  place(event, inside = true) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const part = (at, from, side) => (at - from) / Math.max(side, 1);
    const [x, y] = [part(event.clientX, left, width), part(event.clientY, top, height)];
    return inside ? { x: Math.min(1, Math.max(0, x)), y: Math.min(1, Math.max(0, y)) } : { x, y };
  }

  pull(event) {
    const first = this.pulled === null;
    this.pulled = this.place(event, false);
    if (!first) return;
    setTimeout(() => {
      if (this.pulled !== null) this.send({ do: "pull", ...this.pulled });
      this.pulled = null;
    }, 16);
  }

  drag(event) {
    if (this.pulling === event.pointerId) {
      this.pull(event);
      return;
    }
    if (this.pressed !== null && Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]) >= CLICK) {
      this.pressed = null;
    }
    const before = this.hands.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    // Two fingers: a change of their distance zooms, and their motion pans.
    if (this.hands.size === 2) {
      const other = [...this.hands].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      const grown = apart([event.clientX, event.clientY]) - apart(before);
      this.move("zoom", 0, grown / 60);
      this.move("pan", dx / 2, dy / 2);
    } else {
      const pans = event.shiftKey || (event.buttons & 6) !== 0;
      this.move(pans ? "pan" : "orbit", dx, dy);
    }
    this.hands.set(event.pointerId, [event.clientX, event.clientY]);
  }

  key(event) {
    const by = 24;
    const arrow = { ArrowLeft: [-by, 0], ArrowRight: [by, 0], ArrowUp: [0, -by], ArrowDown: [0, by] }[event.key];
    if (arrow) this.move(event.shiftKey ? "pan" : "orbit", ...arrow);
    else if (event.key === "+" || event.key === "=") this.move("zoom", 0, 1);
    else if (event.key === "-") this.move("zoom", 0, -1);
    else if (event.key === "h" || event.key === "H") this.send({ do: "home" });
    else if (event.key === "Escape") this.send({ do: "unselect" });
    else return;
    event.preventDefault();
  }

  /** Accumulates pointer motion and sends it every 16 ms, because mice report more often than images arrive. */
  move(what, dx, dy) {
    const first = this.moved === null;
    this.moved ??= { orbit: [0, 0], pan: [0, 0], zoom: [0, 0] };
    this.moved[what][0] += dx;
    this.moved[what][1] += dy;
    if (!first) return;
    setTimeout(() => {
      const moved = this.moved;
      this.moved = null;
      // Fractions of the image height, so that a motion has the same effect on every screen.
      const height = Math.max(this.canvas.clientHeight, 1);
      for (const kind of ["orbit", "pan"]) {
        const [x, y] = moved[kind];
        if (x || y) this.send({ do: kind, dx: x / height, dy: y / height });
      }
      if (moved.zoom[1]) this.send({ do: "zoom", by: moved.zoom[1] });
    }, 16);
  }

  /** Requests images in their displayed size. */
  size() {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((n) => Math.round(n * scale));
    if (width > 15 && height > 15) this.send({ do: "size", width, height });
  }
}

/** Draws an image file onto a canvas and resizes the canvas to the image. */
async function paint(canvas, file) {
  const picture = await createImageBitmap(file);
  if (canvas.width !== picture.width || canvas.height !== picture.height) {
    canvas.width = picture.width;
    canvas.height = picture.height;
  }
  canvas.getContext("2d").drawImage(picture, 0, 0);
  picture.close();
}
