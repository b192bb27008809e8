// Draws Meshcat's scene without waiting for it: for computers that have no graphics card.
//
// A browser without one shows a WebGL canvas by reading it back, and its one thread, which also takes the
// mouse, waits for every frame. Here the canvas is out of sight, the picture is fetched when it is done,
// and a plain canvas shows it.

export class FarCanvas {
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
    this.#shown.className = "far";
  }

  // Whether the browser can do it at all.
  get possible() {
    return this.#gl instanceof WebGL2RenderingContext;
  }

  // Whether a picture has been asked for and is not yet here.
  get busy() {
    return this.#fence !== null;
  }

  // Takes the place of the canvas that WebGL draws on.
  show() {
    const canvas = this.#viewer.renderer.domElement;
    canvas.after(this.#shown);
    canvas.style.display = "none";
  }

  // Has the scene drawn, and its picture copied to where it can be fetched.
  draw() {
    const gl = this.#gl;
    this.#viewer.render();
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    if (width !== this.#size[0] || height !== this.#size[1]) this.#resize(width, height);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    this.#fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  // Shows the picture if it is there, and says whether it was.
  fetch() {
    const gl = this.#gl;
    if (gl.getSyncParameter(this.#fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(this.#fence);
    this.#fence = null;
    const [width, height] = this.#size;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, this.#pixels);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    // Another size clears a canvas: not before there is a picture to fill it.
    if (this.#shown.width !== width) this.#shown.width = width;
    if (this.#shown.height !== height) this.#shown.height = height;
    // Rows come bottom first; the style sheet turns the canvas over.
    const picture = new ImageData(new Uint8ClampedArray(this.#pixels.buffer), width, height);
    this.#shown.getContext("2d").putImageData(picture, 0, 0);
    return true;
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
