// A drawing in space that can be turned: parallel projection, Z up, a cloud of points, a path, or both. Places are about
// the middle of the box, in units of its longest side. Nothing moves by itself.

function space(canvas) {
  const scene = JSON.parse(canvas.dataset.space);
  scene.cloud = cloudPoints(scene.cloud ?? "");
  const view = { yaw: scene.yaw, pitch: scene.pitch, zoom: 1 };
  const draw = () => drawSpace(canvas, scene, view);
  const turn = (yaw, pitch) => {
    view.yaw += yaw;
    view.pitch = Math.min(Math.max(view.pitch + pitch, 0), Math.PI / 2);
    draw();
  };
  const closer = factor => {
    view.zoom = Math.min(Math.max(view.zoom * factor, 0.5), 20);
    draw();
  };
  // One finger or the mouse turns it; two fingers come closer as they part.
  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) || 1;
  };
  canvas.addEventListener("pointerdown", event => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, event);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, event => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("pointermove", event => {
    if (!fingers.has(event.pointerId)) return;
    const before = fingers.size === 2 ? spread() : 0;
    fingers.set(event.pointerId, event);
    if (before) closer(spread() / before);
    else if (fingers.size === 1) turn(-event.movementX / 150, event.movementY / 150);
  });
  canvas.addEventListener("wheel", event => {
    if (!event.ctrlKey) return; // the page scrolls
    event.preventDefault();
    closer(Math.exp(-event.deltaY / 400));
  }, { passive: false });
  canvas.addEventListener("keydown", event => {
    const act = {
      ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, 0.1),
      ArrowDown: () => turn(0, -0.1), "+": () => closer(1.2), "-": () => closer(1 / 1.2),
    }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
  canvas.closest("details")?.addEventListener("toggle", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  addEventListener("resize", draw);
  draw();
}

// Four whole numbers of 16 bits a point: its place, a 32767th of the longest side, and its paint.
function cloudPoints(base64) {
  const numbers = new Int16Array(Uint8Array.from(atob(base64), letter => letter.charCodeAt(0)).buffer);
  const points = [];
  for (let k = 0; k < numbers.length; k += 4) {
    points.push({ place: [0, 1, 2].map(axis => numbers[k + axis] / 32767), paint: numbers[k + 3] });
  }
  return points;
}

function drawSpace(canvas, scene, view) {
  const { clientWidth: width, clientHeight: height } = canvas;
  if (!canvas.checkVisibility()) return; // folded
  const density = devicePixelRatio || 1, ink = getComputedStyle(canvas);
  canvas.width = width * density;
  canvas.height = height * density;
  const pen = canvas.getContext("2d");
  pen.scale(density, density);
  pen.font = `12px ${ink.fontFamily}`;
  const size = 0.62 * Math.min(width, 1.5 * height) * view.zoom;
  const [c, s, up, over] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
  // Coming closer leads to the middle of the path.
  const middle = scene.points?.[scene.points.length >> 1] ?? [0, 0, 0], share = Math.max(0, 1 - 1 / view.zoom);
  const place = point => {
    const [x, y, z] = point.map((value, axis) => value - share * middle[axis]);
    return [width / 2 + size * (c * x + s * y), height / 2 - size * (up * z + over * (c * y - s * x))];
  };
  const toward = ([x, y, z]) => over * z - up * (c * y - s * x);
  const line = (points, colour, thick) => {
    pen.beginPath();
    for (const point of points) pen.lineTo(...place(point));
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.stroke();
  };

  // The box, without the edges of its nearest corner, which would cross what is in it.
  const ends = [scene.low, scene.high], floor = scene.low[2];
  const corners = [...Array(8).keys()].map(k => [0, 1, 2].map(axis => ends[(k >> axis) & 1][axis]));
  const nearest = corners.map(toward).reduce((best, depth, k, all) => (depth > all[best] ? k : best), 0);
  const pale = ink.getPropertyValue("--line"), muted = ink.getPropertyValue("--muted");
  pen.globalAlpha = 0.5;
  for (let a = 0; a < 8; a++) {
    for (const b of [a | 1, a | 2, a | 4]) {
      if (a !== b && a !== nearest && b !== nearest) line([corners[a], corners[b]], muted, 1);
    }
  }
  pen.globalAlpha = 1;

  // Points of the cloud, the nearest last.
  const paints = scene.paints?.map(name => ink.getPropertyValue(name));
  const paintOf = paint => paints?.[paint] ?? `rgb(${[10, 5, 0].map(shift => ((paint >> shift) & 31) * 8 + 4)})`;
  const dots = scene.cloud.map(point => ({ ...point, depth: toward(point.place) })).sort((p, q) => p.depth - q.depth);
  const side = 2 * Math.sqrt(view.zoom);
  for (const dot of dots) {
    const [left, top] = place(dot.place);
    pen.fillStyle = paintOf(dot.paint);
    pen.fillRect(left - side / 2, top - side / 2, side, side);
  }

  for (const corners of scene.frusta ?? []) line(scene.outline.map(corner => corners[corner]), ink.color, 1.25);

  // Beside colours of the world the path has one of its own.
  const single = scene.cloud.length ? ink.getPropertyValue("--here") : "";
  for (const [start, stop] of scene.runs ?? []) {
    const run = scene.points.slice(start, stop);
    line(run.map(([x, y]) => [x, y, floor]), pale, 2); // its shadow on the ground
    for (let k = 1; k < run.length; k++) line([run[k - 1], run[k]], single || scene.colours[scene.levels[start + k]], 3);
  }
  const mark = (point, word, colour) => {
    const [left, top] = place(point);
    pen.beginPath();
    pen.arc(left, top, 5, 0, 2 * Math.PI);
    pen.fillStyle = colour;
    pen.fill();
    pen.strokeStyle = ink.backgroundColor; // words stay legible over points and lines
    pen.lineWidth = 3;
    pen.strokeText(word, left + 8, top + 14);
    pen.fillStyle = ink.color;
    pen.fillText(word, left + 8, top + 14);
  };
  if (scene.points?.length) {
    mark(scene.points[0], "start", ink.color);
    mark(scene.points.at(-1), "end", ink.color);
  }
  let words = [];
  for (const [x, y, z, word] of scene.marks ?? []) {
    const [left, top] = place([x, y, z]);
    const free = words.every(([other, above]) => Math.abs(other - left) >= 34 || Math.abs(above - top) >= 15);
    if (free) words.push([left, top]);
    mark([x, y, z], free ? word : "", ink.getPropertyValue("--bad"));
  }

  // Labels of axes stand off the middle of the drawing; those that would touch another are left out.
  pen.fillStyle = muted;
  pen.textBaseline = "middle";
  pen.textAlign = "center";
  words = [];
  for (const [x, y, z, word, distance] of scene.labels) {
    const [left, top] = place([x, y, z]);
    const across = left - width / 2, down = top - height / 2, far = Math.hypot(across, down) || 1;
    const half = pen.measureText(word).width / 2 + 3;
    const middle = Math.min(Math.max(left + (distance * across) / far, half), width - half);
    const line = Math.min(Math.max(top + (distance * down) / far, 8), height - 8);
    if (words.some(other => Math.abs(other.middle - middle) < other.half + half && Math.abs(other.line - line) < 12)) continue;
    words.push({ middle, line, half });
    pen.fillText(word, middle, line);
  }
  pen.textAlign = "left";
  pen.fillText(scene.note ?? "", 8, height - 12);
}
