// Show the coloured points upright: drag to turn, wheel to zoom, shift-drag to pan.
(() => {
  const canvas = document.getElementById('points');
  const gl = canvas && canvas.getContext('webgl', { antialias: true });
  if (!gl) return;
  const bytes = (id) => Uint8Array.from(atob(document.getElementById(id).textContent.trim()), c => c.charCodeAt(0));
  const packed = bytes('points-data');
  const scale = parseFloat(canvas.dataset.scale);
  const count = packed.length / 9;
  const shader = (type, text) => { const s = gl.createShader(type); gl.shaderSource(s, text); gl.compileShader(s); return s; };
  const program = gl.createProgram();
  gl.attachShader(program, shader(gl.VERTEX_SHADER, `
    attribute vec3 low; attribute vec3 high; attribute vec3 colour; uniform mat4 clip; uniform float size; varying vec3 shade;
    void main() { vec3 p = (high * 255.0 * 256.0 + low * 255.0) / 65535.0 * 2.0 - 1.0;
      gl_Position = clip * vec4(p, 1.0); gl_PointSize = clamp(size / gl_Position.w, 1.0, 12.0); shade = colour; }`));
  gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `
    precision mediump float; varying vec3 shade; void main() { gl_FragColor = vec4(shade, 1.0); }`));
  gl.linkProgram(program); gl.useProgram(program);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, packed, gl.STATIC_DRAW);
  ['low', 'high', 'colour'].forEach((name, i) => {
    const at = gl.getAttribLocation(program, name);
    gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, 3, gl.UNSIGNED_BYTE, true, 9, 3 * i);
  });
  gl.enable(gl.DEPTH_TEST); gl.clearColor(0.125, 0.149, 0.169, 1);
  let yaw = 0.5, pitch = 0.45, distance = 2.2, panX = 0, panY = 0;
  const multiply = (a, b) => { const o = new Float32Array(16);
    for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) o[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
    return o; };
  const draw = () => {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth * ratio, h = canvas.clientHeight * ratio;
    if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
    gl.viewport(0, 0, w, h); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const f = 1.6, near = 0.01, far = 20, cy = Math.cos(yaw), sy = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
    const projection = [f * h / w, 0, 0, 0, 0, f, 0, 0, 0, 0, -(far + near) / (far - near), -1, 0, 0, -2 * far * near / (far - near), 0];
    // y is down in Gravity-View: flip y and z to get the picture's y up, then turn and tilt.
    const flip = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1];
    const turn = [cy, 0, -sy, 0, 0, 1, 0, 0, sy, 0, cy, 0, 0, 0, 0, 1];
    const tilt = [1, 0, 0, 0, 0, cp, sp, 0, 0, -sp, cp, 0, panX, panY, -distance, 1];
    gl.uniformMatrix4fv(gl.getUniformLocation(program, 'clip'), false, multiply(new Float32Array(projection), multiply(new Float32Array(tilt), multiply(new Float32Array(turn), new Float32Array(flip)))));
    gl.uniform1f(gl.getUniformLocation(program, 'size'), 2.4 * scale * h);
    gl.drawArrays(gl.POINTS, 0, count);
  };
  let held = null;
  canvas.addEventListener('pointerdown', e => { held = [e.clientX, e.clientY]; canvas.setPointerCapture(e.pointerId); });
  canvas.addEventListener('pointerup', () => { held = null; });
  canvas.addEventListener('pointermove', e => {
    if (!held) return;
    const dx = e.clientX - held[0], dy = e.clientY - held[1]; held = [e.clientX, e.clientY];
    if (e.shiftKey) { panX += dx * distance / 700; panY -= dy * distance / 700; }
    else { yaw += dx / 200; pitch = Math.min(1.55, Math.max(-1.55, pitch + dy / 200)); }
    draw();
  });
  canvas.addEventListener('wheel', e => { e.preventDefault(); distance = Math.min(8, Math.max(0.15, distance * Math.exp(e.deltaY / 600))); draw(); }, { passive: false });
  window.addEventListener('resize', draw);
  draw();
})();
