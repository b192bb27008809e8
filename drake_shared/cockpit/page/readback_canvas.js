// Renders Meshcat's scene asynchronously, for computers without a graphics card.
//
// Without one, the browser reads a visible WebGL canvas back on its main thread, which also handles the
// mouse, and blocks for every frame. Here the WebGL canvas is hidden, its pixels are read back when the
// frame is complete, and a 2-D canvas shows them.

export class ReadbackCanvas {
  #viewer;
  #gl;
  #shown = document.createElement("canvas");
  #buffer = null;
  #pixels = null;
  #fence = null;
  #size = [0, 0];

  constructor(viewer) {
    this.#viewer = viewer;
    this.#gl = viewer.renderer.getContext();
    this.#shown.className = "readback";
  }

  // Whether the browser supports it.
  get supported() {
    return this.#gl instanceof WebGL2RenderingContext;
  }

  // Whether a frame has been started and not been shown yet.
  get busy() {
    return this.#fence !== null;
  }

  // Replaces the WebGL canvas by the 2-D canvas.
  replace() {
    const canvas = this.#viewer.renderer.domElement;
    canvas.after(this.#shown);
    canvas.style.display = "none";
  }

  get canvas() {
    return this.#shown;
  }

  // Starts to render a frame and to copy it to a buffer.
  draw(render) {
    const gl = this.#gl;
    render();
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    if (width !== this.#size[0] || height !== this.#size[1]) this.#resize(width, height);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.#fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  // Fetches the frame if it is complete. Returns whether it was.
  fetch() {
    const gl = this.#gl;
    if (gl.getSyncParameter(this.#fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(this.#fence);
    this.#fence = null;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, this.#pixels);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    return true;
  }

  // Shows the frame that was fetched.
  show() {
    const [width, height] = this.#size;
    // A change of size clears the canvas, so it is made only when there is a frame to show.
    if (this.#shown.width !== width) this.#shown.width = width;
    if (this.#shown.height !== height) this.#shown.height = height;
    // WebGL's first row is the bottom one; the style sheet flips the canvas.
    const picture = new ImageData(new Uint8ClampedArray(this.#pixels.buffer), width, height);
    this.#shown.getContext("2d").putImageData(picture, 0, 0);
  }

  // The square in the middle of the frame that was fetched, as a canvas whose first row is the bottom one.
  square(side) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = side;
    const picture = new ImageData(side, side);
    const [left, bottom] = this.#size.map((length) => Math.floor((length - side) / 2));
    for (let row = 0; row < side; row++) {
      const from = 4 * ((bottom + row) * this.#size[0] + left);
      picture.data.set(this.#pixels.subarray(from, from + 4 * side), 4 * row * side);
    }
    // WebGL multiplies colours by their opacity.
    for (let i = 0; i < picture.data.length; i += 4) {
      const opacity = picture.data[i + 3] / 255;
      for (let k = i; opacity && k < i + 3; k++) picture.data[k] /= opacity;
    }
    canvas.getContext("2d").putImageData(picture, 0, 0);
    return canvas;
  }

  #resize(width, height) {
    const gl = this.#gl;
    this.#size = [width, height];
    this.#pixels = new Uint8Array(4 * width * height);
    gl.deleteBuffer(this.#buffer);
    this.#buffer = gl.createBuffer();
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, this.#pixels.byteLength, gl.STREAM_READ);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  }
}
