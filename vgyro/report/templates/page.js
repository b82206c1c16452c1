"use strict";
(() => {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const drawn = new Map();

  function isDark() {
    return root.dataset.theme ? root.dataset.theme === "dark" : system.matches;
  }

  // Plots hold marks in place of colours; the colour of the scheme in use goes there when they are drawn.
  function coloured(text) {
    const marks = JSON.parse(document.getElementById("colour-marks").textContent);
    const style = getComputedStyle(root);
    return text.replace(/#000[0-9a-f]{3}/g, (mark) => (mark in marks ? style.getPropertyValue("--" + marks[mark]).trim() : mark));
  }

  function visibleSeries(figure) {
    const shown = new Map();
    for (const button of figure.querySelectorAll("button[data-series]")) {
      shown.set(button.dataset.series, button.getAttribute("aria-pressed") === "true");
    }
    return shown;
  }

  async function draw(figure) {
    const box = figure.querySelector(".canvas");
    const item = JSON.parse(coloured(figure.querySelector("script").textContent));
    box.replaceChildren();
    const views = await Bokeh.embed.embed_item(item, box);
    drawn.set(figure, views.roots[0].model);
    show(figure);
    figure.dataset.drawn = "true";
  }

  function show(figure) {
    const plot = drawn.get(figure);
    if (!plot) return;
    const shown = visibleSeries(figure);
    for (const renderer of plot.renderers) {
      if (shown.has(renderer.name)) renderer.visible = shown.get(renderer.name);
    }
  }

  function redraw() {
    for (const figure of drawn.keys()) draw(figure);
  }

  const figures = document.querySelectorAll("figure.plot");
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (entry.isIntersecting) {
        seen.unobserve(entry.target);
        draw(entry.target);
      }
    }
  }, { rootMargin: "400px" });
  for (const figure of figures) {
    seen.observe(figure);
    figure.addEventListener("click", (event) => {
      const button = event.target.closest("button[data-series]");
      if (!button) return;
      button.setAttribute("aria-pressed", button.getAttribute("aria-pressed") === "true" ? "false" : "true");
      show(figure);
    });
  }
  system.addEventListener("change", redraw);

  const button = document.querySelector("button.theme");
  button.hidden = false;
  const label = () => (button.textContent = isDark() ? "light" : "dark");
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    label();
    redraw();
  });
  label();

  const frame = () => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 50)));

  // One part alone on paper: its plots are drawn light, and as wide as a sheet.
  async function printAlone(sheet) {
    const theme = root.dataset.theme;
    root.dataset.theme = "light";
    sheet.classList.add("printed");
    document.body.classList.add("alone");
    const plots = [...sheet.querySelectorAll("figure.plot")].filter((figure) => figure.checkVisibility());
    await Promise.all(plots.map(draw));
    await frame();
    window.print();
    document.body.classList.remove("alone");
    sheet.classList.remove("printed");
    if (theme) root.dataset.theme = theme;
    else delete root.dataset.theme;
    plots.forEach(draw);
  }
  for (const printer of document.querySelectorAll("button.print")) {
    printer.hidden = false;
    printer.addEventListener("click", () => printAlone(document.getElementById(printer.dataset.print)));
  }

  // A link into a closed part opens it.
  function openTarget() {
    const target = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let part = target; part; part = part.parentElement) {
      if (part.tagName === "DETAILS") part.open = true;
    }
    if (target) target.scrollIntoView();
  }
  addEventListener("hashchange", openTarget);
  openTarget();

  const links = new Map([...document.querySelectorAll("nav a")].map((link) => [link.hash.slice(1), link]));
  const inView = new IntersectionObserver((entries) => {
    for (const entry of entries) links.get(entry.target.id)?.classList.toggle("here", entry.isIntersecting);
  }, { rootMargin: "-10% 0px -70% 0px" });
  for (const id of links.keys()) {
    const target = document.getElementById(id);
    if (target) inView.observe(target);
  }
  if (links.size && matchMedia("(max-width: 60rem)").matches) document.querySelector("details.contents").open = false;
})();
