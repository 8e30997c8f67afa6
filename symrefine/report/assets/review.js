// What the page of a review does beyond being read: groups are chosen, and the choices saved as a file.
// They are kept in the browser too, where it lets a page keep anything, so that closing the page loses nothing.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const KEPT = `symrefine.decisions.${data.key}`;
  const objects = new Map(data.objects.map((object) => [object.object, object]));
  const cards = [...document.querySelectorAll(".object")];
  const state = new Map();
  let saved = "";

  for (const element of document.querySelectorAll(".needs-script")) element.hidden = false;

  // A decision for each object that has one, as the file has them

  function decision(object, chosen) {
    return {
      object: object.object,
      file: object.file,
      sha256: object.sha256,
      point_group: chosen.group,
      tolerance: chosen.tolerance,
      mirrors_only_in_shape: chosen.group !== null && chosen.mirrors,
      note: chosen.note,
    };
  }

  function decisions() {
    const found = [];
    for (const object of data.objects) {
      const chosen = state.get(object.object);
      // What was decided before and is open again is said as such.
      if (chosen.group !== null || object.decision) found.push(decision(object, chosen));
    }
    return found.sort((a, b) => a.object - b.object);
  }

  function text() {
    const rows = decisions().map((row) => `    ${JSON.stringify(row)}`).join(",\n");
    return `{\n  "schema": ${JSON.stringify(data.schema)},\n  "decisions": [\n${rows}\n  ]\n}\n`;
  }

  function keep() {
    try {
      localStorage.setItem(KEPT, JSON.stringify([...state]));
    } catch { /* a browser that keeps nothing for files */ }
  }

  function kept() {
    try {
      return new Map(JSON.parse(localStorage.getItem(KEPT) ?? "[]"));
    } catch {
      return new Map();
    }
  }

  // Cards

  const part = (card, selector) => card.querySelector(selector);
  const objectOf = (card) => objects.get(Number(card.dataset.object));

  function draw(card) {
    const object = objectOf(card), chosen = state.get(object.object);
    const step = object.tolerances.indexOf(chosen.tolerance);
    const likely = object.likely[step], best = object.best[step];
    const pressed = object.options.findIndex((option) => option.group === chosen.group);
    const shown = pressed >= 0 ? pressed : best ?? 0;
    for (const button of card.querySelectorAll("[data-choice]")) {
      const k = Number(button.dataset.choice);
      button.disabled = false;
      button.setAttribute("aria-pressed", String(k === pressed));
      button.classList.toggle("answer", k === best);
      part(button, "span").textContent = likely ? likely[k] : "";
    }
    for (const shot of card.querySelectorAll("[data-shot]")) shot.hidden = Number(shot.dataset.shot) !== shown;
    const told = part(card, ".told"), option = object.options[shown];
    const said = option && (likely || pressed >= 0) ? option.told : "Undetermined at this tolerance.";
    if (told.textContent !== said) told.textContent = said;
    const select = part(card, ".tolerance"), mirrors = part(card, ".mirrors"), note = part(card, ".note");
    select.disabled = false;
    select.selectedIndex = step;
    mirrors.disabled = pressed < 0 || !object.options[pressed].mirrors;
    mirrors.checked = !mirrors.disabled && chosen.mirrors;
    note.disabled = pressed < 0;
    if (note.value !== chosen.note) note.value = chosen.note;
    card.classList.toggle("chosen", pressed >= 0);
  }

  function change(card, changes) {
    const number = Number(card.dataset.object);
    state.set(number, { ...state.get(number), ...changes });
    draw(card);
    keep();
    tell();
  }

  function choose(card, k) {
    const object = objectOf(card), group = object.options[k]?.group;
    if (group === undefined) return;
    const again = state.get(object.object).group === group;
    change(card, { group: again ? null : group, mirrors: again ? false : state.get(object.object).mirrors });
  }

  function tell() {
    const open = data.objects.filter((object) => object.state === "open");
    const done = open.filter((object) => state.get(object.object).group !== null).length;
    const now = text();
    byId("progress").textContent = `${done} of ${open.length} decided` + (now === saved ? "" : ", not saved");
    byId("text").value = now;
  }

  // Saving

  function save() {
    saved = text();
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([saved], { type: "application/json" }));
    link.download = "decisions.json";
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    tell();
  }

  byId("save").addEventListener("click", save);
  byId("show").addEventListener("click", () => {
    const area = byId("text");
    area.hidden = !area.hidden;
    byId("show").setAttribute("aria-expanded", String(!area.hidden));
    if (!area.hidden) area.select();
  });
  addEventListener("beforeunload", (event) => {
    if (text() !== saved) event.preventDefault();
  });

  // Hands and keys

  for (const card of cards) {
    card.addEventListener("click", (event) => {
      const button = event.target.closest("[data-choice]");
      if (button) choose(card, Number(button.dataset.choice));
    });
    part(card, ".tolerance").addEventListener("change", (event) => {
      change(card, { tolerance: objectOf(card).tolerances[event.target.selectedIndex] });
    });
    part(card, ".mirrors").addEventListener("change", (event) => change(card, { mirrors: event.target.checked }));
    part(card, ".note").addEventListener("input", (event) => change(card, { note: event.target.value }));
  }

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target.closest("input[type=text], textarea, select")) return;
    const here = cards.indexOf(event.target.closest(".object"));
    const step = { j: 1, k: -1 }[event.key];
    if (step) {
      const next = cards[Math.min(Math.max(here + step, 0), cards.length - 1)];
      next?.focus({ preventScroll: true });
      next?.scrollIntoView({ block: "nearest" });
    } else if (event.key === "s") {
      save();
    } else if (here >= 0 && /^[1-9]$/.test(event.key)) {
      choose(cards[here], Number(event.key) - 1);
    }
  });

  const before = kept();
  for (const object of data.objects) {
    const own = object.decision;
    state.set(object.object, own
      ? { group: own.point_group, tolerance: own.tolerance, mirrors: own.mirrors_only_in_shape, note: own.note }
      : { group: null, tolerance: object.tolerance, mirrors: false, note: "" });
    if (!object.tolerances.includes(state.get(object.object).tolerance)) {
      state.get(object.object).tolerance = object.tolerance;
    }
  }
  saved = text();
  for (const [number, chosen] of before) {
    const object = objects.get(number);
    const known = chosen.group === null || object?.options.some((option) => option.group === chosen.group);
    if (object && known && object.tolerances.includes(chosen.tolerance)) state.set(number, chosen);
  }
  cards.forEach(draw);
  tell();
})();
