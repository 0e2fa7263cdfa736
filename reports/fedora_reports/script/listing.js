// Lists that can be searched, filtered and put into another order. Without a script they stand in the order of the record.

function listing(root) {
  const search = root.querySelector("[data-search]");
  if (!search) return;
  const order = root.querySelector("[data-order]");
  const filters = [...root.querySelectorAll("[data-filter]")];
  const count = root.querySelector("[data-count]");
  const flat = root.querySelector("[data-items]");
  const folds = [...root.querySelectorAll("[data-rest]")];
  const groups = [...root.querySelectorAll("[data-group]")];
  const items = [...root.querySelectorAll(".item")];
  const homes = items.map(item => item.parentElement);
  let words = null;

  const fits = (item, k, query) =>
    words[k].includes(query) && filters.every(filter => !filter.value || item.dataset[filter.dataset.filter] === filter.value);

  function apply() {
    words ??= items.map(item => item.textContent.toLowerCase());
    const query = search.value.trim().toLowerCase();
    let shown = 0;
    items.forEach((item, k) => {
      item.hidden = !fits(item, k, query);
      shown += !item.hidden;
    });
    const key = order.value;
    for (const k of key ? ordered(items, key) : items.keys()) (key ? flat : homes[k]).append(items[k]);
    for (const group of groups) group.hidden = !group.querySelector(".item:not([hidden])");
    for (const fold of folds) {
      fold.hidden = !fold.querySelector(".item:not([hidden])");
      fold.open ||= shown < items.length;
    }
    count.textContent = shown < items.length ? `${shown} of ${items.length}` : "";
  }

  root.addEventListener("input", apply);
  // A link may lead to what is filtered out at present.
  root.addEventListener("show-all", () => {
    search.value = "";
    for (const filter of filters) filter.value = "";
    apply();
  });
}

// The places of the items in the order of one of their values; a minus before its name turns it round. Items without
// the value come last, equal ones stay in the order of the record.
function ordered(items, key) {
  const name = key.replace(/^-/, ""), sign = key.startsWith("-") ? -1 : 1;
  const value = k => items[k].dataset[name] || null;
  const compared = (a, b) => {
    if (a === null || b === null) return (a === null) - (b === null);
    const difference = Number(a) - Number(b);
    return sign * (Number.isNaN(difference) ? a.localeCompare(b, "en") : difference);
  };
  return [...items.keys()].sort((j, k) => compared(value(j), value(k)) || j - k);
}
