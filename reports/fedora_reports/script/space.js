// The path in space, that can be turned: parallel projection, Z up. Points are about the middle of the box, in units of
// its longest side.

function space(canvas) {
  const scene = JSON.parse(canvas.dataset.space);
  const view = { yaw: 0.6, pitch: 0.5, zoom: 1 };
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
  canvas.addEventListener("pointerdown", event => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    if (event.buttons) turn(-event.movementX / 150, event.movementY / 150);
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
  canvas.closest("details").addEventListener("toggle", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  addEventListener("resize", draw);
}

function drawSpace(canvas, scene, view) {
  const { clientWidth: width, clientHeight: height } = canvas;
  if (!width) return; // folded
  const density = devicePixelRatio || 1, ink = getComputedStyle(canvas);
  canvas.width = width * density;
  canvas.height = height * density;
  const pen = canvas.getContext("2d");
  pen.scale(density, density);
  pen.font = `13px ${ink.fontFamily}`;
  const size = 0.62 * Math.min(width, 1.5 * height) * view.zoom;
  const [c, s, up, over] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
  const place = ([x, y, z]) => [width / 2 + size * (c * x + s * y), height / 2 - size * (up * z + over * (c * y - s * x))];
  const line = (points, colour, thick) => {
    pen.beginPath();
    for (const point of points) pen.lineTo(...place(point));
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.stroke();
  };
  const [[x0, y0, z0], [x1, y1, z1]] = [scene.low, scene.high], pale = ink.getPropertyValue("--line");
  line([[x0, y0, z0], [x1, y0, z0], [x1, y1, z0], [x0, y1, z0], [x0, y0, z0], [x0, y0, z1]], pale, 1.5);
  pen.fillStyle = ink.getPropertyValue("--muted");
  pen.fillText("X east", ...place([x1, y0, z0]));
  pen.fillText("Y north", ...place([x0, y1, z0]));
  pen.fillText("Z up", ...place([x0, y0, z1]));
  pen.fillText(`longest side of the box ${scene.span_m} m`, 8, height - 8);
  for (const [start, stop] of scene.runs) {
    const run = scene.points.slice(start, stop);
    line(run.map(([x, y]) => [x, y, z0]), pale, 2); // its shadow on the ground
    for (let k = 1; k < run.length; k++) line([run[k - 1], run[k]], scene.colours[scene.levels[start + k]], 3);
  }
  const dot = (point, radius, colour) => {
    pen.beginPath();
    pen.arc(...place(point), radius, 0, 2 * Math.PI);
    pen.fillStyle = colour;
    pen.fill();
  };
  pen.fillStyle = ink.color;
  const ends = [[scene.points[0], "start"], [scene.points.at(-1), "end"]];
  for (const [point, word] of ends) {
    dot(point, 5, ink.color);
    const [x, y] = place(point);
    pen.fillText(word, x + 8, y + 14);
  }
  const labels = [];
  for (const [x, y, z, word] of scene.marks) {
    dot([x, y, z], 5, ink.getPropertyValue("--bad"));
    const [left, top] = place([x, y, z]);
    if (labels.some(([other, above]) => Math.abs(other - left) < 34 && Math.abs(above - top) < 15)) continue;
    labels.push([left, top]);
    pen.fillText(word, left + 8, top - 6);
  }
}
