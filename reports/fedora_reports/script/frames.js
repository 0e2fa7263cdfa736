// One instant at a time, large: along the sequence, and around findings. Without a script all moments stand in rows, and
// the places of findings beside them.

function frames(section) {
  const viewer = section.querySelector("[data-viewer]");
  if (!viewer) return;
  const stage = viewer.querySelector("[data-stage]");
  const slider = viewer.querySelector("[data-slider]");
  const layer = viewer.querySelector("[data-layer]");
  const timeline = section.querySelector(".timeline");
  const stops = [...section.querySelectorAll(".instant")]
    .map(element => ({ element, us: microseconds(element), finding: element.closest(".finding") }))
    .sort((a, b) => (a.us > b.us) - (a.us < b.us)); // those without a time are at Infinity, the last
  if (!stops.length) return;
  const playheads = timeline ? [...timeline.querySelectorAll(".track")].map(addPlayhead) : [];
  slider.max = stops.length - 1;

  function show(k, finding) {
    const stop = stops[k];
    const copy = stop.element.cloneNode(true);
    copy.removeAttribute("id");
    copy.querySelector(".time")?.append(` · ${k + 1} of ${stops.length}`);
    const about = finding ?? stop.finding;
    if (about) copy.querySelector(".panels").append(said(about));
    stage.replaceChildren(copy);
    slider.value = k;
    slider.setAttribute("aria-valuetext", stop.element.querySelector(".time")?.textContent ?? `${k + 1}`);
    if (timeline) movePlayheads(stop.us);
  }

  function movePlayheads(us) {
    const { low, high } = timeline.dataset;
    const share = (us - low) / (high - low), known = share >= 0 && share <= 1;
    for (const line of playheads) {
      line.setAttribute("x1", `${known ? 100 * share : 0}%`);
      line.setAttribute("x2", `${known ? 100 * share : 0}%`);
      line.setAttribute("visibility", known ? "visible" : "hidden");
    }
  }

  // Show where a finding is worst, or the instant nearest to it; false where it has neither pictures nor a time.
  function showFinding(finding) {
    const own = stops.findIndex(stop => stop.finding === finding && stop.element.matches(".worst"));
    const k = own >= 0 ? own : nearest(microseconds(finding));
    if (k < 0) return false;
    show(k, finding);
    return true;
  }

  function nearest(us) {
    const far = stops.map(stop => Math.abs(stop.us - us));
    const least = Math.min(...far);
    return Number.isFinite(least) ? far.indexOf(least) : -1;
  }

  function follow(event) {
    if (event.ctrlKey || event.metaKey || event.shiftKey || event.altKey) return;
    const link = event.target.closest("a.mark, a.stop, a.see");
    if (link) {
      const target = document.getElementById(link.getAttribute("href").slice(1));
      const finding = link.closest(".finding") ?? target?.closest(".finding");
      const moment = stops.findIndex(stop => stop.element === target);
      if (finding ? !showFinding(finding) : moment < 0) return;
      if (!finding) show(moment);
      event.preventDefault();
      if (!link.closest(".timeline")) viewer.scrollIntoView({ block: "start" });
      return;
    }
    const track = event.target.closest(".timeline .track");
    if (!track) return;
    const box = track.getBoundingClientRect(), { low, high } = timeline.dataset;
    show(nearest(Number(low) + ((event.clientX - box.left) / box.width) * (high - low)));
  }

  section.addEventListener("click", follow);
  slider.addEventListener("input", () => show(Number(slider.value)));
  viewer.addEventListener("click", event => {
    const step = Number(event.target.closest("[data-step]")?.dataset.step ?? 0);
    if (step) show(Math.min(Math.max(Number(slider.value) + step, 0), stops.length - 1));
  });
  layer.addEventListener("input", () => { viewer.dataset.shown = layer.value; });
  crossHair(stage);
  const first = stops.findIndex(stop => stop.finding && stop.element.matches(".worst"));
  const opening = document.getElementById(viewer.dataset.opening);
  if (!opening || !showFinding(opening)) show(Math.max(first, 0));
  return { show: element => {
    const k = stops.findIndex(stop => stop.element === element);
    if (k >= 0) show(k);
  } };
}

function microseconds(element) {
  return element.dataset.us === undefined ? Infinity : Number(element.dataset.us);
}

// What a finding says, with the link to it.
function said(finding) {
  const line = document.createElement("p"), link = document.createElement("a");
  link.href = `#${finding.id}`;
  link.textContent = finding.querySelector(".tag").textContent;
  line.className = "said";
  line.append(link, " ", finding.querySelector(".message").textContent);
  return line;
}

function addPlayhead(track) {
  const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
  line.setAttribute("class", "playhead");
  line.setAttribute("y1", "0");
  line.setAttribute("y2", "100%");
  track.append(line);
  return line;
}

// The same place in all pictures, as they look through one field of view.
function crossHair(stage) {
  stage.addEventListener("pointermove", event => {
    const frame = event.target.closest(".frame");
    stage.classList.toggle("crossed", Boolean(frame));
    if (!frame) return;
    const box = frame.getBoundingClientRect();
    stage.style.setProperty("--x", `${(100 * (event.clientX - box.left)) / box.width}%`);
    stage.style.setProperty("--y", `${(100 * (event.clientY - box.top)) / box.height}%`);
  });
  stage.addEventListener("pointerleave", () => stage.classList.remove("crossed"));
}
