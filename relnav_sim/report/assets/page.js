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

  // Case switch: one case, or all.
  const choice = document.getElementById("case-switch");
  if (choice) {
    choice.closest("label").hidden = false;
    const show = () => {
      for (const part of document.querySelectorAll("[data-case]")) {
        part.hidden = choice.value !== "" && part.dataset.case !== choice.value;
        if (choice.value !== "" && !part.hidden && part.matches("details.case")) part.open = true;
      }
    };
    choice.addEventListener("change", show);
    show();
  }

  // A link to a case opens it; a print shows everything.
  const follow = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (target && target.matches("details.case")) target.open = true;
  };
  addEventListener("hashchange", follow);
  follow();
  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((part) => { part.open = true; }));
})();
