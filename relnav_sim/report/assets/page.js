"use strict";
(() => {
  // Sortable tables: a click on a heading sorts by it, a second click turns the order round.
  const value = (row, column) => {
    const cell = row.cells[column];
    if (!cell) return Infinity;  // a filter without runs has one cell over all columns
    const order = cell.dataset.order;
    return order === undefined ? cell.textContent.trim() : order === "inf" ? Infinity : Number(order);
  };
  for (const table of document.querySelectorAll("table.sortable")) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const body = table.tBodies[0];
      const rows = [...body.rows].sort((a, b) => {
        const [p, q] = [value(a, column), value(b, column)];
        if (typeof p === "number" && typeof q === "number") {
          if (p === q) return 0;
          if (p === Infinity || q === Infinity) return p === Infinity ? 1 : -1;  // missing figures stay last
          return down ? q - p : p - q;
        }
        return (down ? -1 : 1) * String(p).localeCompare(String(q), undefined, { numeric: true });
      });
      body.append(...rows);
    }));
  }

  // Each table as CSV: the numbers that sorting goes by, where a cell has one, and what else stands in the cell.
  const quoted = (text) => /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  const words = (part) => part ? part.textContent.trim().replace(/\s+/g, " ").replaceAll("\u2212", "-") : "";
  const safe = (text) => /^[=+@\t]|^-(?![\d.\u221e])/.test(text) ? `'${text}` : text;  // no formula in a spreadsheet
  const commaSeparated = (table) => {
    const heads = [...table.tHead.rows].map((row) => [...row.cells].flatMap((cell) => Array(cell.colSpan).fill(words(cell))));
    const labels = heads.length < 2 ? heads[0] : [heads[0][0], ...heads[1].map((label, place) => `${heads[0][place + 1]} ${label}`.trim())];
    const lines = [labels.flatMap((label, place) => place ? [label, `${label}, interval and note`] : [label]).map(safe)];
    for (const row of table.tBodies[0].rows) {
      if (row.hidden) continue;
      lines.push([...row.cells].flatMap((cell, place) => {
        if (!place) return [safe(words(cell))];
        const number = cell.querySelector(".n"), more = [...cell.querySelectorAll(".ci")].map(words).join(" ");
        const value = !number ? safe(words(cell)) : cell.dataset.order === "inf" ? words(number) : cell.dataset.order;
        return [value, safe(more), ...Array(2 * (cell.colSpan - 1)).fill("")];
      }));
    }
    return lines.map((line) => line.map(quoted).join(",")).join("\n") + "\n";
  };
  for (const button of document.querySelectorAll("button.csv")) {
    button.hidden = false;
    button.addEventListener("click", () => {
      const figure = button.closest("figure"), link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([commaSeparated(figure.querySelector("table"))], { type: "text/csv" }));
      link.download = `${figure.id}.csv`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  // Columns of the tables that stand under one filter's heading.
  const columnsOf = (table, wanted) => {
    const groups = [];
    for (const head of [...table.tHead.rows[0].cells].slice(1)) for (let i = 0; i < head.colSpan; i++) groups.push(head.textContent);
    const show = (cells, skip) => {
      let column = 0;
      for (const cell of [...cells].slice(skip)) { cell.hidden = wanted !== "" && groups[column] !== wanted; column += cell.colSpan; }
    };
    show(table.tHead.rows[0].cells, 1);
    show(table.tHead.rows[1].cells, 0);
    for (const row of table.tBodies[0].rows) show(row.cells, 1);
  };

  // A link into a folded part opens it, and those around it.
  const unfold = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let part = target && target.closest("details"); part; part = part.parentElement.closest("details")) part.open = true;
    if (target) target.scrollIntoView();
  };
  addEventListener("hashchange", unfold);
  unfold();

  // Switches: one case or all, one filter or all.
  const [cases, filters] = ["case-switch", "filter-switch"].map((id) => document.getElementById(id));
  const wants = (choice, name) => !choice || choice.value === "" || name === undefined || name === choice.value;
  const show = () => {
    for (const part of document.querySelectorAll("[data-case],[data-filter]")) {
      part.hidden = !wants(cases, part.dataset.case) || !wants(filters, part.dataset.filter);
      if (cases && cases.value !== "" && !part.hidden && part.matches("details.case")) part.open = true;
    }
    const wanted = filters ? filters.value : "";
    for (const table of document.querySelectorAll("table.filters")) columnsOf(table, wanted);
  };
  for (const [choice, name] of [[cases, "relnav-case"], [filters, "relnav-filter"]]) {
    if (!choice) continue;
    choice.closest("label").hidden = false;
    choice.addEventListener("change", () => { show(); dispatchEvent(new CustomEvent(name, { detail: choice.value })); });
    choice.value = "";
  }

  // Light or dark: the system's choice until the button says otherwise; remembered where the browser allows it.
  const theme = document.getElementById("theme-switch"), root = document.documentElement;
  const dark = () => root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  const name = () => { theme.textContent = dark() ? "Light" : "Dark"; theme.setAttribute("aria-label", `Show the page ${dark() ? "light" : "dark"}`); };
  try { const kept = localStorage.getItem("relnav-theme"); if (kept) root.dataset.theme = kept; } catch { /* a page from disk may keep nothing */ }
  theme.hidden = false;
  theme.addEventListener("click", () => {
    root.dataset.theme = dark() ? "light" : "dark";
    try { localStorage.setItem("relnav-theme", root.dataset.theme); } catch { /* as above */ }
    name();
  });
  name();

  // A link to a case opens it; a print shows everything.
  const follow = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target && target.matches("details.case")) target.open = true;
  };
  addEventListener("hashchange", follow);
  follow();
  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
})();
