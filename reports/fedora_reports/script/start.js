// The page is whole without all of this.

document.documentElement.classList.add("js");

document.addEventListener("DOMContentLoaded", () => {
  for (const root of document.querySelectorAll("[data-listing]")) listing(root);
  for (const canvas of document.querySelectorAll("[data-space]")) space(canvas);
  for (const button of document.querySelectorAll("[data-copy]")) button.addEventListener("click", () => copy(button));
  const viewers = [...document.querySelectorAll(".file")].map(frames);

  // A link may lead to what is folded, filtered out, or shown elsewhere.
  function arrive() {
    const target = document.getElementById(location.hash.slice(1));
    if (!target) return;
    const item = target.closest(".item");
    if (item?.hidden) item.closest("[data-listing]").dispatchEvent(new Event("show-all"));
    for (let part = target; part; part = part.parentElement) if (part.tagName === "DETAILS") part.open = true;
    if (target.matches(".instant")) for (const viewer of viewers) viewer?.show(target);
    (target.matches(".instant") ? target.closest(".viewer") ?? target : target).scrollIntoView();
  }
  addEventListener("hashchange", arrive);
  arrive();
});
