// The picture of the stage, and the hand that turns it.

class Stage {
  constructor(canvas, send) {
    this.canvas = canvas;
    this.send = send;
    this.moved = null;
    this.hands = new Map();
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
      this.hands.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => this.hands.delete(event.pointerId));
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

  drag(event) {
    const before = this.hands.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    // Two fingers: what changes their distance zooms, the rest moves.
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
    else return;
    event.preventDefault();
  }

  /** Gathers what the hand does until the next frame: mice report more often than pictures come. */
  move(what, dx, dy) {
    const first = this.moved === null;
    this.moved ??= { orbit: [0, 0], pan: [0, 0], zoom: [0, 0] };
    this.moved[what][0] += dx;
    this.moved[what][1] += dy;
    if (!first) return;
    setTimeout(() => {
      const moved = this.moved;
      this.moved = null;
      // Parts of the picture's height, so that a hand's way means the same on every screen.
      const height = Math.max(this.canvas.clientHeight, 1);
      for (const kind of ["orbit", "pan"]) {
        const [x, y] = moved[kind];
        if (x || y) this.send({ do: kind, dx: x / height, dy: y / height });
      }
      if (moved.zoom[1]) this.send({ do: "zoom", by: moved.zoom[1] });
    }, 16);
  }

  /** Asks for pictures as large as they are shown. */
  size() {
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((n) => Math.round(n * scale));
    if (width > 15 && height > 15) this.send({ do: "size", width, height });
  }
}

/** Draws a file of pictures onto a canvas of its size. */
async function paint(canvas, file) {
  const picture = await createImageBitmap(file);
  if (canvas.width !== picture.width || canvas.height !== picture.height) {
    canvas.width = picture.width;
    canvas.height = picture.height;
  }
  canvas.getContext("2d").drawImage(picture, 0, 0);
  picture.close();
}
