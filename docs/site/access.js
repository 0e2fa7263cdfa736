// What a keyboard and a screen reader need: a name of the search, and code and tables that scroll by arrow keys.
document.querySelector(".md-search")?.setAttribute("aria-label", "Search");
new MutationObserver(() => {
  for (const region of document.querySelectorAll(".md-typeset :is(pre > code, .md-typeset__scrollwrap)")) {
    if (region.scrollWidth > region.clientWidth) region.tabIndex = 0;
  }
}).observe(document.body, { childList: true, subtree: true });
