"use strict";
// The page is whole without this. It adds zooming, shows the lane of a row that is clicked, and
// unfolds chatter for the printer.
(() => {
  const SHORTEST = 5e3, SVG = "http://www.w3.org/2000/svg";
  const all = (selector, within = document) => [...within.querySelectorAll(selector)];

  // The axis is as the program has drawn it before anybody zoomed: it says between which marks there
  // are no more than so many. How marks are called is said here and in `ticks.rs` alike.
  const axis = document.querySelector("[data-steps]")?.dataset;
  const steps = axis?.steps.split(" ").map(Number), most = Number(axis?.ticks);
  function ticks(from, to) {
    const count = (step) => Math.floor(to / step) - Math.ceil(from / step) + 1;
    const longest = steps.at(-1);
    const step = steps.find((step) => count(step) <= most)
      ?? longest * (Math.floor(count(longest) / most) + 1);
    const at = [];
    for (let n = Math.ceil(from / step); n <= Math.floor(to / step); n++) at.push(n * step);
    return { step, at };
  }
  function label(at, step) {
    const us = Math.abs(at), sign = at < 0 ? "−" : "", two = (n) => String(n).padStart(2, "0");
    const seconds = Math.floor(us / 1e6), ms = Math.floor(us / 1e3) % 1e3;
    const fraction = String(ms).padStart(3, "0");
    if (us === 0) return "0";
    if (us < 1e6) return `${sign}${ms} ms`;
    if (us < 60e6) {
      const digits = step < 1e4 ? 3 : step < 1e5 ? 2 : step < 1e6 ? 1 : 0;
      return `${sign}${seconds}${digits ? "." + fraction.slice(0, digits) : ""} s`;
    }
    const minutes = Math.floor(seconds / 60) % 60, hours = Math.floor(seconds / 3600);
    const end = `${two(seconds % 60)}${step < 1e6 ? "." + fraction : ""}`;
    return sign + (hours ? `${hours}:${two(minutes)}:${end}` : `${minutes}:${end}`);
  }
  function drawn(tag, attributes, text = "") {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.textContent = text;
    return element;
  }

  // The charts of one figure, which all show the same stretch of time.
  class Picture {
    constructor(figure) {
      this.figure = figure;
      this.charts = all("svg", figure);
      this.box = figure.querySelector(".scroll");
      this.left = Number(this.charts[0].dataset.left);
      this.width = Number(this.charts[0].dataset.width);
      this.whole = [Number(figure.dataset.from), Number(figure.dataset.to)];
      [this.from, this.to] = this.whole;
      const isPlaced = (element) => !element.closest(".ticks");
      this.placed = all("[data-a]", figure).filter(isPlaced).map((element) => {
        const a = Number(element.dataset.a), b = Number(element.dataset.b ?? a);
        return { element, a, b, isBar: element.tagName === "rect" };
      });
      this.ends = all(".end", figure).map((end) => ({ end, text: end.textContent }));
    }

    x(at) {
      const part = Math.min(Math.max(at, this.from), this.to) - this.from;
      return this.left + part / (this.to - this.from) * this.width;
    }
    // The time under the mouse.
    at(event) {
      const place = this.charts[0].getBoundingClientRect();
      const unit = this.charts[0].viewBox.baseVal.width / place.width;
      const part = ((event.clientX - place.left) * unit - this.left) / this.width;
      return this.from + Math.min(Math.max(part, 0), 1) * (this.to - this.from);
    }

    show(newFrom, newTo) {
      const [least, most] = this.whole, middle = (newFrom + newTo) / 2;
      const span = Math.min(Math.max(newTo - newFrom, SHORTEST), most - least);
      this.from = Math.min(Math.max(middle - span / 2, least), most - span);
      this.to = this.from + span;
      this.draw();
    }
    showAll() { this.show(...this.whole); }
    showEarly() { this.show(-5e3, 105e3); }
    zoom(by, at = (this.from + this.to) / 2) {
      this.show(at - (at - this.from) * by, at + (this.to - at) * by);
    }
    move(by) {
      const us = by * (this.to - this.from);
      this.show(this.from + us, this.to + us);
    }

    draw() {
      for (const { element, a, b, isBar } of this.placed) {
        const isSeen = a <= this.to && b >= this.from;
        element.setAttribute("display", isSeen ? "inline" : "none");
        if (!isSeen) continue;
        element.setAttribute(isBar ? "x" : "x1", this.x(a));
        if (isBar) element.setAttribute("width", Math.max(this.x(b) - this.x(a), 0));
        else element.setAttribute("x2", this.x(a));
      }
      const found = ticks(this.from, this.to);
      for (const chart of this.charts) this.drawAxis(chart, found);
      const isWhole = this.from === this.whole[0] && this.to === this.whole[1];
      this.ends.forEach(({ end, text }, n) => {
        const offset = n % 2 ? this.to : this.from;
        end.textContent = isWhole ? text : label(Math.round(offset), 1e3);
      });
    }
    drawAxis(chart, { step, at }) {
      const group = chart.querySelector(".ticks"), bottom = chart.dataset.bottom;
      group.dataset.step = step;
      group.replaceChildren(...at.flatMap((at) => {
        const x = this.x(at);
        return [drawn("line", { class: "grid", x1: x, x2: x, y1: 26, y2: bottom }),
          drawn("text", { class: "axis", x, y: 18 }, label(at, step))];
      }));
    }

    addButtons() {
      const bar = document.createElement("span");
      bar.className = "zoom";
      const add = (text, name, act) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = text;
        if (name) button.title = name;
        if (name) button.setAttribute("aria-label", name);
        button.addEventListener("click", act);
        bar.append(button);
      };
      add("+", "zoom in", () => this.zoom(1 / 2));
      add("−", "zoom out", () => this.zoom(2));
      add("←", "earlier", () => this.move(-1 / 4));
      add("→", "later", () => this.move(1 / 4));
      add("first 100 ms", "", () => this.showEarly());
      add("whole", "", () => this.showAll());
      this.figure.querySelector("figcaption").append(bar);
    }
    hearKeys() {
      const whole = () => this.showAll(), closer = () => this.zoom(1 / 2);
      const acts = { "+": closer, "=": closer, "-": () => this.zoom(2),
        ArrowLeft: () => this.move(-1 / 4), ArrowRight: () => this.move(1 / 4),
        Home: whole, "0": whole, "1": () => this.showEarly() };
      this.box.addEventListener("keydown", (event) => {
        const act = acts[event.key];
        if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        act();
      });
    }
    // The wheel zooms, and a stretch of time that is marked with the mouse is shown.
    hearMouse() {
      let began = null, marked = null;
      this.box.addEventListener("wheel", (event) => {
        if (!event.ctrlKey && !event.shiftKey) return;
        event.preventDefault();
        this.zoom((event.deltaY || event.deltaX) > 0 ? 1.3 : 1 / 1.3, this.at(event));
      }, { passive: false });
      this.box.addEventListener("dblclick", () => this.showAll());
      this.box.addEventListener("pointerdown", (event) => {
        const chart = event.target.closest("svg");
        if (!chart || event.button !== 0 || event.pointerType === "touch") return;
        began = { chart, at: this.at(event) };
        event.preventDefault();
        this.box.focus({ preventScroll: true });
      });
      addEventListener("pointermove", (event) => {
        if (!began) return;
        const [one, other] = [this.x(began.at), this.x(this.at(event))];
        if (!marked && Math.abs(one - other) < 4) return;
        marked?.remove();
        marked = drawn("rect", { class: "picked", x: Math.min(one, other), y: 26,
          width: Math.abs(one - other), height: began.chart.dataset.bottom - 26 });
        began.chart.append(marked);
      });
      addEventListener("pointerup", (event) => {
        const ends = began && marked ? [began.at, this.at(event)] : [0, 0];
        marked?.remove();
        began = marked = null;
        if (ends[0] !== ends[1]) this.show(Math.min(...ends), Math.max(...ends));
      });
    }
  }

  for (const figure of all("figure.picture")) {
    const picture = new Picture(figure);
    picture.addButtons();
    picture.hearKeys();
    picture.hearMouse();
    picture.box.classList.add("zoomable");
  }

  function light(lane) {
    all(".lane.lit").forEach((lit) => lit.classList.remove("lit"));
    const found = all(`.lane[data-lane="${lane}"]`);
    found.forEach((found) => found.classList.add("lit"));
    return found[0];
  }
  document.querySelector(".sequence").addEventListener("click", (event) => {
    const row = event.target.closest("tr[data-lane]");
    if (!row || event.target.closest("details") || String(getSelection())) return;
    event.preventDefault();
    light(row.dataset.lane)?.scrollIntoView({ block: "center" });
  });

  let unfolded = [];
  addEventListener("beforeprint", () => {
    unfolded = all("details:not([open])");
    unfolded.forEach((details) => { details.open = true; });
  });
  addEventListener("afterprint", () => unfolded.forEach((details) => { details.open = false; }));
})();
