// Drawing with WebGL 2. One image contains both scenes: each is drawn on its side of the divider,
// then the result is composited over the background. Blending uses 16-bit floats where supported,
// because the rounding errors of hundreds of thin layers would add up in 8 bits.

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

  /** Loads the decoded scene: tables of texels, and the ranges of lines that move. */
  load({ header, geometry, look, moving }) {
    const { gl } = this;
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (Math.max(geometry.lines, look.lines) > most) throw new Error(`The scene needs textures of more than ${most} lines, the most this device has`);
    this.header = header;
    this.moving = moving;
    this.tables = { geometry: this.table(geometry), look: this.table(look) };
    const rows = header.groups.reduce((sum, count) => sum + count, 0);
    this.orders = [0, 1].map(() => {
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
    const { program, uniforms } = this.splats;
    gl.useProgram(program);
    gl.uniform1i(uniforms.u_geometry, 0);
    gl.uniform1i(uniforms.u_look, 1);
    gl.uniform1i(uniforms.u_geometry_per_line, geometry.perLine);
    gl.uniform1i(uniforms.u_look_per_line, look.perLine);
    gl.uniform1i(uniforms.u_look_texels, look.texels);
    gl.uniform1i(uniforms.u_sh_degree, header.sh_degree);
    gl.uniform3i(uniforms.u_groups, ...header.groups.slice(0, 3));
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

  /** Uploads an answer of the worker: new texels of the moving lines, and both draw orders. */
  update(frame) {
    const { gl } = this;
    for (const name of ["geometry", "look"]) {
      if (!frame[name]) continue;
      const { texture, width } = this.tables[name];
      gl.bindTexture(gl.TEXTURE_2D, texture);
      let at = 0;
      for (const [line, count] of this.moving[name]) {
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, line, width, count, gl.RGBA, gl.FLOAT, frame[name], at);
        at += width * count * 4;
      }
    }
    [frame.first, frame.second].forEach((order, which) => {
      const count = frame.counts[which];
      this.orders[which].count = count;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.orders[which].buffer);
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
   * Draws. `view`: {rows, eye, focal, principal, near, size} for an image of the canvas's size; `wipe`: share of the width that shows the
   * first scene; `scale`: resolution of the image over that of the canvas.
   */
  draw(view, wipe, scale) {
    const { gl, canvas } = this;
    const width = Math.max(1, Math.round(canvas.width * scale)), height = Math.max(1, Math.round(canvas.height * scale));
    this.resize(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const { program, uniforms } = this.splats;
    gl.useProgram(program);
    const ratio = [width / canvas.width, height / canvas.height];
    gl.uniform4fv(uniforms.u_view, view.rows.flat());
    gl.uniform3fv(uniforms.u_eye, view.eye);
    gl.uniform1f(uniforms.u_near, view.near);
    gl.uniform2f(uniforms.u_focal, view.focal[0] * ratio[0], view.focal[1] * ratio[1]);
    gl.uniform2f(uniforms.u_principal, view.principal[0] * ratio[0], view.principal[1] * ratio[1]);
    gl.uniform2f(uniforms.u_size, width, height);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.tables.geometry.texture);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.tables.look.texture);
    gl.activeTexture(gl.TEXTURE0);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.SCISSOR_TEST);
    const split = Math.round(wipe * width);
    [[0, split], [split, width - split]].forEach(([from, columns], which) => {
      const { vertices, count } = this.orders[which];
      if (columns <= 0 || count === 0) return;
      gl.scissor(from, 0, columns, height);
      gl.uniform1i(uniforms.u_second, which);
      gl.bindVertexArray(vertices);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    });
    gl.bindVertexArray(null);
    gl.disable(gl.SCISSOR_TEST);
    gl.disable(gl.BLEND);

    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.useProgram(this.present.program);
    gl.bindTexture(gl.TEXTURE_2D, this.image);
    gl.uniform1i(this.present.uniforms.u_image, 0);
    gl.uniform3fv(this.present.uniforms.u_background, this.background);
    gl.uniform2f(this.present.uniforms.u_ratio, 1 / ratio[0], 1 / ratio[1]);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
