// Show the coloured points upright (y is down, as in Gravity-View). The page says how to use it.
(() => {
  const canvas = document.getElementById('points');
  const gl = canvas && canvas.getContext('webgl', { antialias: true });
  if (!gl) return; // the message and the pictures stay
  const groups = JSON.parse(canvas.dataset.groups), first = JSON.parse(canvas.dataset.view);
  const packed = Uint8Array.from(atob(document.getElementById('points-data').textContent), c => c.charCodeAt(0));

  const program = gl.createProgram();
  const attach = (type, text) => { const s = gl.createShader(type); gl.shaderSource(s, text); gl.compileShader(s); gl.attachShader(program, s); };
  attach(gl.VERTEX_SHADER, `
    attribute vec3 low, high, colour; uniform mat4 clip; uniform float size; varying vec3 shade;
    void main() {
      vec3 place = (high * 255.0 * 256.0 + low * 255.0) / 65535.0 * 2.0 - 1.0;
      gl_Position = clip * vec4(place, 1.0);
      gl_PointSize = clamp(size / gl_Position.w, 1.5, 40.0);
      shade = colour;
    }`);
  attach(gl.FRAGMENT_SHADER, `
    precision mediump float; varying vec3 shade;
    void main() { if (length(gl_PointCoord - 0.5) > 0.5) discard; gl_FragColor = vec4(shade, 1.0); }`);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return;
  gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, packed, gl.STATIC_DRAW);
  ['low', 'high', 'colour'].forEach((name, i) => {
    const at = gl.getAttribLocation(program, name);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, 3, gl.UNSIGNED_BYTE, true, 9, 3 * i);
  });
  gl.enable(gl.DEPTH_TEST);
  gl.clearColor(0.125, 0.149, 0.169, 1);
  document.getElementById('viewer').hidden = false;
  document.getElementById('no-viewer').hidden = true;

  let view;
  const reset = () => { view = { ...first, centre: [...first.centre] }; };
  // The camera's axes: right, down and forward (OpenCV), and where it stands.
  const camera = () => {
    const { yaw, elevation, distance, centre } = view;
    const ce = Math.cos(elevation), se = Math.sin(elevation), cy = Math.cos(yaw), sy = Math.sin(yaw);
    const forward = [sy * ce, se, cy * ce], right = [cy, 0, -sy], down = [-sy * se, ce, -cy * se];
    return { right, down, forward, eye: centre.map((c, i) => c - distance * forward[i]) };
  };
  const clipMatrix = (aspect) => {
    const { right, down, forward, eye } = camera();
    const near = 0.02 * view.distance, far = view.distance + 6;
    const a = (far + near) / (far - near), b = -2 * far * near / (far - near), f = view.focal;
    const row = (axis, factor) => [...axis.map(v => v * factor), -factor * axis.reduce((s, v, i) => s + v * eye[i], 0)];
    const x = row(right, f / aspect), y = row(down, -f), w = row(forward, 1), z = row(forward, a);
    z[3] += b;
    const columns = [];
    for (let c = 0; c < 4; c++) columns.push(x[c], y[c], z[c], w[c]);
    return columns;
  };
  const isShown = (name) => { const box = document.querySelector(`input[data-group="${name}"]`); return !box || box.checked; };
  const uniform = (name) => gl.getUniformLocation(program, name);
  const draw = () => {
    const ratio = window.devicePixelRatio || 1;
    const w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    gl.viewport(0, 0, w, h);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(uniform('clip'), false, clipMatrix(w / h));
    for (const group of groups.filter(g => isShown(g.name))) {
      gl.uniform1f(uniform('size'), 2.4 * group.spacing * view.focal * h / 2);
      gl.drawArrays(gl.POINTS, group.start, group.count);
    }
  };

  const turn = (dx, dy) => {
    view.yaw += dx;
    view.elevation = Math.min(1.55, Math.max(-1.55, view.elevation + dy));
  };
  const move = (dx, dy) => {
    const { right, down } = camera(), step = 2 * view.distance / (view.focal * canvas.clientHeight);
    view.centre = view.centre.map((c, i) => c - step * (dx * right[i] + dy * down[i]));
  };
  const zoom = (factor) => { view.distance = Math.min(8, Math.max(0.02, view.distance * factor)); };
  let held = null;
  canvas.addEventListener('pointerdown', e => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, () => { held = null; });
  canvas.addEventListener('pointermove', e => {
    if (!held) return;
    const dx = e.clientX - held[0], dy = e.clientY - held[1];
    held = [e.clientX, e.clientY];
    if (e.shiftKey) move(dx, dy); else turn(dx / 200, dy / 200);
    draw();
  });
  // Only once it was clicked: a wheel that scrolls the page shall not end here.
  canvas.addEventListener('wheel', e => {
    if (document.activeElement !== canvas) return;
    e.preventDefault();
    zoom(Math.exp(e.deltaY / 600));
    draw();
  }, { passive: false });
  const keys = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    '+': () => zoom(0.9), '=': () => zoom(0.9), '-': () => zoom(1.1),
  };
  canvas.addEventListener('keydown', e => { if (keys[e.key]) { e.preventDefault(); keys[e.key](); draw(); } });
  document.getElementById('reset').addEventListener('click', () => { reset(); draw(); });
  document.querySelectorAll('input[data-group]').forEach(box => box.addEventListener('change', draw));
  window.addEventListener('resize', draw);
  reset();
  draw();
})();
