// A slider for each joint of each robot.

const PLOTTED_AT_FIRST = 6;

class Joints {
  /** `send` sends a command; `changed` is called when the set of plotted joints changes. */
  constructor(box, send, changed) {
    this.box = box;
    this.send = send;
    this.changed = changed;
    this.rows = [];
  }

  /** Rebuilds the sliders. */
  build(robots) {
    this.rows = [];
    this.box.replaceChildren();
    let plotted = 0;
    for (const [r, robot] of robots.entries()) {
      const details = document.createElement("details");
      details.className = "robot";
      details.open = true;
      const summary = document.createElement("summary");
      summary.textContent = `${robot.name} (${robot.joints.length})`;
      details.append(summary);
      for (const [j, joint] of robot.joints.entries()) {
        const row = this.row(r, j, robot, joint);
        row.mark.checked = plotted < PLOTTED_AT_FIRST && joint.driven;
        if (row.mark.checked) plotted += 1;
        details.append(row.element);
        this.rows.push(row);
      }
      this.box.append(details);
    }
  }

  row(r, j, robot, joint) {
    const element = document.createElement("div");
    element.className = "joint";
    const mark = document.createElement("input");
    mark.type = "checkbox";
    mark.className = "mark";
    mark.setAttribute("aria-label", `Plot ${joint.name}`);
    const color = COLORS[this.rows.length % COLORS.length];
    mark.style.setProperty("--mark", color);
    mark.addEventListener("change", this.changed);
    const name = document.createElement("label");
    name.className = "name";
    name.textContent = joint.name;
    name.title = joint.name;
    const value = document.createElement("output");
    element.append(mark, name, value);
    const row = { r, j, joint, element, mark, value, color, column: this.rows.length, held: -Infinity };
    if (!joint.driven) {
      const follows = document.createElement("span");
      follows.className = "follows";
      follows.textContent = "passive or mimic";
      element.append(follows);
      return row;
    }
    const id = `joint-${r}-${j}`;
    name.htmlFor = id;
    const slider = document.createElement("input");
    slider.type = "range";
    slider.id = id;
    slider.dataset.robot = robot.name;
    slider.dataset.joint = joint.name;
    [row.lower, row.upper] = joint.slider;
    slider.min = row.lower;
    slider.max = row.upper;
    slider.step = "any";
    slider.addEventListener("input", () => {
      row.held = performance.now();
      this.send({ do: "target", robot: robot.name, joint: joint.name, value: slider.valueAsNumber });
    });
    // Arrow keys on a slider without steps move by a hundredth of its range.
    slider.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (by === undefined) return;
      event.preventDefault();
      slider.valueAsNumber += by * (row.upper - row.lower) / 100;
      slider.dispatchEvent(new Event("input"));
    });
    const now = document.createElement("span");
    now.className = "now";
    const travel = document.createElement("div");
    travel.className = "travel";
    travel.append(slider, now);
    element.append(travel);
    return Object.assign(row, { slider, now });
  }

  /** Shows joint positions and targets on the sliders. */
  show(robots) {
    for (const row of this.rows) {
      const robot = robots[row.r];
      if (!robot) continue;
      const [q, target] = [robot.positions[row.j], robot.targets[row.j]];
      const unit = row.joint.unit;
      row.value.textContent = q === null || q === undefined ? "–" : `${(Math.abs(q) < 5e-4 ? 0 : q).toFixed(3)} ${unit}`;
      if (!row.slider) continue;
      // A slider that was just dragged ignores the reported target.
      if (performance.now() - row.held > 400 && Number.isFinite(target)) row.slider.valueAsNumber = target;
      const at = (q - row.lower) / (row.upper - row.lower);
      row.now.style.left = `${(Math.min(1, Math.max(0, at)) * 100).toFixed(2)}%`;
      const title = `position ${q?.toFixed(4)} ${unit}, target ${target?.toFixed(4)} ${unit}`;
      if (row.now.title !== title) row.now.title = title;
    }
  }

  /** Returns the plotted columns with their colors. */
  lines() {
    return this.rows.filter((row) => row.mark.checked).map(({ column, color }) => ({ column, color }));
  }
}
