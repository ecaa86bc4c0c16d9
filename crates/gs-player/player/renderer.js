// Drawing with WebGL 2. One image contains all visible scenes, each in its cell; then the image is
// composited over the background. Blending uses 16-bit floats where supported, because the rounding
// errors of hundreds of thin layers would add up in 8 bits.

/** Texels of a line of an overlay's texture; every WebGL 2 device has at least this width. */
const OVERLAY_LINE = 2048;

class Renderer {
  /** Throws an error with a user-readable message if the browser cannot draw. */
  constructor(canvas, background) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" });
    if (!gl) throw new Error("WebGL 2 is not available");
    this.gl = gl;
    this.canvas = canvas;
    this.background = background;
    this.floats = Boolean(gl.getExtension("EXT_color_buffer_float") ?? gl.getExtension("EXT_color_buffer_half_float"));
    gl.getExtension("OES_texture_float_linear");
    this.splats = this.program(SPLAT_VERTEX, SPLAT_FRAGMENT);
    this.present = this.program(COVER_VERTEX, PRESENT_FRAGMENT);
    this.sources = [];
    this.blank = this.overlayTexture(new Uint8Array(4), 1, 1);
    this.image = gl.createTexture();
    this.target = gl.createFramebuffer();
    this.imageSize = [0, 0];
  }

  program(vertex, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text.trim());
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`The graphics driver refused a shader: ${gl.getShaderInfoLog(shader)}`);
      }
    }
    gl.bindAttribLocation(program, 0, "a_row");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`The graphics driver refused a program: ${gl.getProgramInfoLog(program)}`);
    }
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const name = gl.getActiveUniform(program, i).name.replace("[0]", "");
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return { program, uniforms };
  }

  /** Loads a decoded payload in place of the one with this index: tables of texels, and the ranges of lines that move. */
  load(index, { header, geometry, appearance, moving }) {
    const { gl } = this;
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (Math.max(geometry.lines, appearance.lines) > most) throw new Error(`The scene needs textures of more than ${most} lines, the most this device has`);
    const old = this.sources[index];
    if (old) {
      for (const { texture } of Object.values(old.tables)) gl.deleteTexture(texture);
      for (const { vertices, buffer } of old.orders) {
        gl.deleteVertexArray(vertices);
        gl.deleteBuffer(buffer);
      }
      this.paint(index, null);
    }
    const rows = header.groups.reduce((sum, count) => sum + count, 0);
    const orders = [0, 1].map(() => {
      const vertices = gl.createVertexArray(), buffer = gl.createBuffer();
      gl.bindVertexArray(vertices);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, rows * 4, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 4, 0);
      gl.vertexAttribDivisor(0, 1);
      return { vertices, buffer, count: 0 };
    });
    gl.bindVertexArray(null);
    this.sources[index] = {
      header,
      moving,
      orders,
      tables: { geometry: this.table(geometry), appearance: this.table(appearance) },
      perLine: { geometry: geometry.perLine, appearance: appearance.perLine },
      appearanceTexels: appearance.texels,
      overlay: null,
    };
  }

  overlayTexture(data, width, lines) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, lines, 0, gl.RGBA, gl.UNSIGNED_BYTE, data);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return texture;
  }

  /** Sets the colours that the appearances of a payload are mixed with: RGB and share, a byte each; `null` for none. */
  paint(index, colors) {
    const source = this.sources[index];
    if (source.overlay) this.gl.deleteTexture(source.overlay);
    source.overlay = null;
    if (!colors) return;
    const lines = Math.max(1, Math.ceil(colors.length / 4 / OVERLAY_LINE));
    const texels = new Uint8Array(lines * OVERLAY_LINE * 4);
    texels.set(colors);
    source.overlay = this.overlayTexture(texels, OVERLAY_LINE, lines);
  }

  table({ width, lines, data }) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, width, lines);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, lines, gl.RGBA, gl.FLOAT, data);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return { texture, width };
  }

  /** Uploads an answer of a worker: new texels of the moving lines, and both draw orders. */
  update(index, frame) {
    const { gl } = this;
    const source = this.sources[index];
    gl.activeTexture(gl.TEXTURE0);
    for (const name of ["geometry", "appearance"]) {
      if (!frame[name]) continue;
      const { texture, width } = source.tables[name];
      gl.bindTexture(gl.TEXTURE_2D, texture);
      let at = 0;
      for (const [line, count] of source.moving[name]) {
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, line, width, count, gl.RGBA, gl.FLOAT, frame[name], at);
        at += width * count * 4;
      }
    }
    [frame.first, frame.second].forEach((order, which) => {
      const count = frame.counts[which];
      source.orders[which].count = count;
      gl.bindBuffer(gl.ARRAY_BUFFER, source.orders[which].buffer);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, order, 0, count);
    });
  }

  /** Allocates the blended image with `width` × `height` pixels. */
  resize(width, height) {
    const { gl } = this;
    if (this.imageSize[0] === width && this.imageSize[1] === height) return;
    this.imageSize = [width, height];
    gl.bindTexture(gl.TEXTURE_2D, this.image);
    const [inner, type] = this.floats ? [gl.RGBA16F, gl.HALF_FLOAT] : [gl.RGBA8, gl.UNSIGNED_BYTE];
    gl.texImage2D(gl.TEXTURE_2D, 0, inner, width, height, 0, gl.RGBA, type, null);
    for (const [name, value] of [
      ["TEXTURE_MIN_FILTER", gl.LINEAR], ["TEXTURE_MAG_FILTER", gl.LINEAR],
      ["TEXTURE_WRAP_S", gl.CLAMP_TO_EDGE], ["TEXTURE_WRAP_T", gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, gl[name], value);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.image, 0);
  }

  /**
   * Draws. `cells`: {source, second, view, x, y, width, height, clip}, pixels of the canvas from its upper left corner, where `view` is
   * {rows, eye, focal, principal, near, size} for an image of the cell's size, and `clip` the first and last column that are drawn;
   * `scale`: resolution of the image over that of the canvas.
   */
  draw(cells, scale) {
    const { gl, canvas } = this;
    const width = Math.max(1, Math.round(canvas.width * scale)), height = Math.max(1, Math.round(canvas.height * scale));
    const ratio = [width / canvas.width, height / canvas.height];
    this.resize(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.useProgram(this.splats.program);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.SCISSOR_TEST);
    for (const cell of cells) this.drawCell(cell, ratio, height);
    gl.bindVertexArray(null);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.BLEND);

    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.useProgram(this.present.program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.image);
    gl.uniform1i(this.present.uniforms.u_image, 0);
    gl.uniform3fv(this.present.uniforms.u_background, this.background);
    gl.uniform2f(this.present.uniforms.u_ratio, 1 / ratio[0], 1 / ratio[1]);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  drawCell({ source: index, second, view, x, y, width, height, clip }, ratio, imageHeight) {
    const { gl } = this;
    const source = this.sources[index];
    const { vertices, count } = source?.orders[second] ?? { count: 0 };
    const round = (value, axis) => Math.round(value * ratio[axis]);
    const left = round(x, 0), top = round(y, 1);
    const columns = Math.max(1, round(x + width, 0) - left), lines = Math.max(1, round(y + height, 1) - top);
    const from = round(clip[0], 0), to = round(clip[1], 0);
    if (to <= from || count === 0) return;
    // Rows of the image count upwards in WebGL.
    const bottom = imageHeight - top - lines;
    gl.viewport(left, bottom, columns, lines);
    gl.scissor(from, bottom, to - from, lines);
    const { uniforms } = this.splats;
    const { header, tables, perLine, appearanceTexels, overlay } = source;
    const within = [columns / width, lines / height];
    gl.uniform1i(uniforms.u_geometry, 0);
    gl.uniform1i(uniforms.u_appearance, 1);
    gl.uniform1i(uniforms.u_overlay, 2);
    gl.uniform1i(uniforms.u_geometry_per_line, perLine.geometry);
    gl.uniform1i(uniforms.u_appearance_per_line, perLine.appearance);
    gl.uniform1i(uniforms.u_appearance_texels, appearanceTexels);
    gl.uniform1i(uniforms.u_sh_degree, header.sh_degree);
    gl.uniform3i(uniforms.u_groups, ...header.groups.slice(0, 3));
    gl.uniform1i(uniforms.u_second, second);
    gl.uniform1i(uniforms.u_overlay_per_line, overlay ? OVERLAY_LINE : 0);
    gl.uniform4fv(uniforms.u_view, view.rows.flat());
    gl.uniform3fv(uniforms.u_eye, view.eye);
    gl.uniform1f(uniforms.u_near, view.near);
    gl.uniform2f(uniforms.u_focal, view.focal[0] * within[0], view.focal[1] * within[1]);
    gl.uniform2f(uniforms.u_principal, view.principal[0] * within[0], view.principal[1] * within[1]);
    gl.uniform2f(uniforms.u_size, columns, lines);
    gl.uniform2f(uniforms.u_origin, left, bottom);
    [tables.geometry.texture, tables.appearance.texture, overlay ?? this.blank].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
    });
    gl.bindVertexArray(vertices);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
  }
}
