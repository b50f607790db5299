"use strict";
// Zoom and reading of polar traces. The page says everything without it: what this adds, it makes itself.
(() => {
  const MOST = 16;
  const make = (name, text, into) => {
    const made = document.createElement(name);
    made.textContent = text;
    into.append(made);
    return made;
  };
  const signed = (um) => (um < 0 ? "−" : "+") + Math.abs(um).toFixed(1);

  for (const figure of document.querySelectorAll("figure.polar")) {
    const svg = figure.querySelector("svg");
    const size = svg.viewBox.baseVal.width;
    const scale = Number(svg.dataset.scale), nominal = Number(svg.dataset.radius);
    const traces = [...svg.querySelectorAll("polygon")].map((polygon) => ({
      name: polygon.dataset.name,
      points: [...polygon.points].map(({ x, y }) => [
        Math.atan2(size / 2 - y, x - size / 2),
        (Math.hypot(x - size / 2, y - size / 2) - nominal) / scale,
      ]),
    }));
    let factor = 1, middle = [size / 2, size / 2], grip = null;

    const show = () => {
      const side = size / factor;
      middle = middle.map((at) => Math.min(Math.max(at, side / 2), size - side / 2));
      svg.setAttribute("viewBox", `${middle[0] - side / 2} ${middle[1] - side / 2} ${side} ${side}`);
      svg.style.touchAction = factor > 1 ? "none" : "";
      svg.style.setProperty("--thin", 1 / Math.sqrt(factor));
    };
    const zoom = (by, at = middle) => {
      const before = factor;
      factor = Math.min(Math.max(factor * by, 1), MOST);
      middle = middle.map((old, k) => at[k] + (old - at[k]) * (before / factor));
      show();
    };
    const move = (x, y) => { middle = [middle[0] + x, middle[1] + y]; show(); };
    const whole = () => { factor = 1; show(); };
    const place = (event) => {
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      return [point.x, point.y];
    };

    const tools = make("div", "", figure);
    tools.className = "tools";
    const title = figure.querySelector("figcaption b").textContent;
    for (const [text, what, work] of [["+", "Enlarge", () => zoom(2)], ["−", "Reduce", () => zoom(0.5)], ["Whole", "Whole of", whole]]) {
      const button = make("button", text, tools);
      button.type = "button";
      button.setAttribute("aria-label", `${what} ${title}`);
      button.addEventListener("click", work);
    }
    const reading = make("p", "", figure);
    reading.className = "reading";

    tools.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!step || factor === 1) return;
      event.preventDefault();
      move(...step.map((one) => one * size / factor / 8));
    });
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;  // the wheel alone scrolls the page
      event.preventDefault();
      zoom(event.deltaY < 0 ? 1.25 : 0.8, place(event));
    }, { passive: false });
    svg.addEventListener("pointerdown", (event) => {
      if (factor === 1) return;
      grip = place(event);
      svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointerup", () => { grip = null; });
    svg.addEventListener("pointercancel", () => { grip = null; });
    svg.addEventListener("pointermove", (event) => {
      const at = place(event);
      if (grip) { move(grip[0] - at[0], grip[1] - at[1]); return; }
      const angle = Math.atan2(size / 2 - at[1], at[0] - size / 2);
      const apart = (other) => Math.abs(Math.atan2(Math.sin(other - angle), Math.cos(other - angle)));
      const read = traces.map(({ name, points }) => {
        const nearest = points.reduce((best, point) => (apart(point[0]) < apart(best[0]) ? point : best));
        return `${name} ${signed(nearest[1])} µm`;
      });
      const degrees = (Math.round(angle * 180 / Math.PI) + 360) % 360;
      reading.textContent = `${degrees}°: ${read.join(", ")}`;
    });
    svg.addEventListener("pointerleave", () => { reading.textContent = ""; });
    addEventListener("beforeprint", whole);
  }
})();
