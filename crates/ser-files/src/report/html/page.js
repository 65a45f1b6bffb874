"use strict";
// The page is whole without this. It adds zooming, and shows the lane of a row that is clicked.
(() => {
  const MINUTE = 60e6, HOUR = 60 * MINUTE, DAY = 24 * HOUR;
  const STEPS = [1e3, 2e3, 5e3, 1e4, 2e4, 5e4, 1e5, 2e5, 5e5, 1e6, 2e6, 5e6, 10e6, 15e6, 30e6,
    MINUTE, 2 * MINUTE, 5 * MINUTE, 10 * MINUTE, 15 * MINUTE, 30 * MINUTE, HOUR, 2 * HOUR,
    3 * HOUR, 6 * HOUR, 12 * HOUR, DAY, 7 * DAY];
  const MOST_TICKS = 10, SHORTEST = 5e3, SVG = "http://www.w3.org/2000/svg";

  // As the program has drawn the axis before anybody zoomed.
  function ticks(from, to) {
    const count = (step) => Math.floor(to / step) - Math.ceil(from / step) + 1;
    let step = STEPS.find((step) => count(step) <= MOST_TICKS);
    step ??= 7 * DAY * (Math.floor(count(7 * DAY) / MOST_TICKS) + 1);
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

  function zoomable(figure) {
    const svg = figure.querySelector("svg"), box = figure.querySelector(".scroll");
    const left = Number(svg.dataset.left), width = Number(svg.dataset.width);
    const bottom = Number(svg.dataset.bottom);
    const whole = [Number(figure.dataset.from), Number(figure.dataset.to)];
    let [from, to] = whole;
    const placed = [...svg.querySelectorAll("[data-a]")].filter((e) => !e.closest(".ticks"));
    const ends = svg.querySelectorAll(".end"), texts = [...ends].map((end) => end.textContent);

    const x = (at) => left + (Math.min(Math.max(at, from), to) - from) / (to - from) * width;
    function draw() {
      for (const element of placed) {
        const a = Number(element.dataset.a);
        const b = element.dataset.b === undefined ? a : Number(element.dataset.b);
        const isSeen = a <= to && b >= from;
        element.setAttribute("display", isSeen ? "inline" : "none");
        if (!isSeen) continue;
        if (element.tagName === "rect") {
          element.setAttribute("x", x(a));
          element.setAttribute("width", Math.max(x(b) - x(a), 0));
        } else {
          element.setAttribute("x1", x(a));
          element.setAttribute("x2", x(a));
        }
      }
      const found = ticks(from, to), group = svg.querySelector(".ticks");
      group.dataset.step = found.step;
      group.replaceChildren(...found.at.flatMap((at) => {
        const line = document.createElementNS(SVG, "line");
        line.setAttribute("class", "grid");
        for (const [name, value] of [["x1", x(at)], ["x2", x(at)], ["y1", 26], ["y2", bottom]])
          line.setAttribute(name, value);
        const text = document.createElementNS(SVG, "text");
        text.setAttribute("class", "axis");
        text.setAttribute("x", x(at));
        text.setAttribute("y", 18);
        text.textContent = label(at, found.step);
        return [line, text];
      }));
      const isWhole = from === whole[0] && to === whole[1];
      ends.forEach((end, n) => {
        const offset = [from, to][n];
        end.textContent = isWhole ? texts[n] : label(Math.round(offset), 1e3);
      });
    }
    function show(newFrom, newTo) {
      const middle = (newFrom + newTo) / 2, most = whole[1] - whole[0];
      const span = Math.min(Math.max(newTo - newFrom, SHORTEST), most);
      from = Math.min(Math.max(middle - span / 2, whole[0]), whole[1] - span);
      to = from + span;
      draw();
    }
    const zoom = (by, at = (from + to) / 2) => show(at - (at - from) * by, at + (to - at) * by);
    const move = (by) => show(from + by * (to - from), to + by * (to - from));
    const all = () => show(...whole), early = () => show(-5e3, 105e3);

    const bar = document.createElement("span");
    bar.className = "zoom";
    for (const [text, name, act] of [["+", "zoom in", () => zoom(1 / 2)],
      ["−", "zoom out", () => zoom(2)], ["←", "earlier", () => move(-1 / 4)],
      ["→", "later", () => move(1 / 4)], ["first 100 ms", "", early], ["whole", "", all]]) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = text;
      if (name) {
        button.title = name;
        button.setAttribute("aria-label", name);
      }
      button.addEventListener("click", act);
      bar.append(button);
    }
    figure.querySelector("figcaption").append(bar);
    box.classList.add("zoomable");
    box.addEventListener("keydown", (event) => {
      const act = { "+": () => zoom(1 / 2), "=": () => zoom(1 / 2), "-": () => zoom(2),
        ArrowLeft: () => move(-1 / 4), ArrowRight: () => move(1 / 4), Home: all, "0": all,
        "1": early }[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
    });

    const at = (event) => {
      const place = svg.getBoundingClientRect();
      const unit = svg.viewBox.baseVal.width / place.width;
      const part = ((event.clientX - place.left) * unit - left) / width;
      return from + Math.min(Math.max(part, 0), 1) * (to - from);
    };
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.shiftKey) return;
      event.preventDefault();
      zoom((event.deltaY || event.deltaX) > 0 ? 1.3 : 1 / 1.3, at(event));
    }, { passive: false });
    svg.addEventListener("dblclick", all);
    // A stretch of time that is marked with the mouse is shown.
    let began = null, picked = null;
    svg.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || event.pointerType === "touch") return;
      began = at(event);
      event.preventDefault();
      box.focus({ preventScroll: true });
    });
    addEventListener("pointermove", (event) => {
      if (began === null) return;
      const now = at(event);
      if (!picked && Math.abs(x(now) - x(began)) < 4) return;
      if (!picked) {
        picked = document.createElementNS(SVG, "rect");
        picked.setAttribute("class", "picked");
        picked.setAttribute("y", 26);
        picked.setAttribute("height", bottom - 26);
        svg.append(picked);
      }
      picked.setAttribute("x", Math.min(x(now), x(began)));
      picked.setAttribute("width", Math.abs(x(now) - x(began)));
    });
    addEventListener("pointerup", (event) => {
      const [start, end] = [began, picked && at(event)];
      picked?.remove();
      began = picked = null;
      if (start !== null && end !== null && start !== end)
        show(Math.min(start, end), Math.max(start, end));
    });
  }

  document.querySelectorAll("figure.picture").forEach(zoomable);

  function light(lane) {
    document.querySelectorAll(".lane.lit").forEach((lit) => lit.classList.remove("lit"));
    const found = document.querySelectorAll(`.lane[data-lane="${lane}"]`);
    found.forEach((found) => found.classList.add("lit"));
    return found[0];
  }
  document.querySelectorAll("tr[data-lane]").forEach((row) => row.addEventListener("click", (event) => {
    if (event.target.closest("details") || String(getSelection())) return;
    event.preventDefault();
    light(row.dataset.lane)?.scrollIntoView({ block: "center" });
  }));
})();
