// Timeline of a recording, shown only during playback.

class Timeline {
  /** Inserts the timeline before `bar`; `send` sends a command. */
  constructor(bar, send) {
    this.label = document.createElement("label");
    this.label.id = "timeline-row";
    this.label.hidden = true;
    this.label.style.cssText = "display:flex;gap:8px;align-items:center";
    this.slider = document.createElement("input");
    this.slider.type = "range";
    this.slider.id = "timeline";
    this.slider.setAttribute("aria-label", "Time of the recording");
    this.slider.style.flex = "1";
    this.text = document.createElement("output");
    this.label.append("Time", this.slider, this.text);
    bar.before(this.label);
    this.held = false;
    this.slider.addEventListener("pointerdown", () => { this.held = true; });
    for (const end of ["pointerup", "pointercancel", "blur"]) {
      this.slider.addEventListener(end, () => { this.held = false; });
    }
    this.slider.addEventListener("input", () => send({ do: "seek", time: Number(this.slider.value) }));
  }

  /** Shows the playback time; `timeline` is null for a running simulation. */
  show(timeline) {
    this.label.hidden = timeline === null;
    if (timeline === null) return;
    this.slider.min = timeline.start;
    this.slider.max = timeline.end;
    this.slider.step = "any";
    if (!this.held) this.slider.value = timeline.now;
    this.text.textContent = `${timeline.now.toFixed(2)} of ${timeline.end.toFixed(2)} s`;
  }
}
