// From metres on the map to pixels of its canvas, and back.

export class Camera {
  constructor() {
    Object.assign(this, { x: 0, y: 0, scale: 6, width: 1, height: 1, moved: 0 });
  }

  resize(width, height) {
    Object.assign(this, { width, height });
    this.moved++;
  }

  fit([[left, low], [right, high]], margin = 14) {
    this.x = (left + right) / 2;
    this.y = (low + high) / 2;
    this.scale = Math.min(this.width / (right - left + 2 * margin), this.height / (high - low + 2 * margin));
    this.moved++;
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
    this.moved++;
  }

  zoom(factor, px, py) {
    const before = this.toMap(px, py);
    this.scale = Math.max(0.8, Math.min(60, this.scale * factor));
    const after = this.toMap(px, py);
    this.x += before.x - after.x;
    this.y += before.y - after.y;
    this.moved++;
  }

  toMap(px, py) {
    return { x: this.x + (px - this.width / 2) / this.scale, y: this.y - (py - this.height / 2) / this.scale };
  }

  toPixel({ x, y }) {
    return { x: this.width / 2 + (x - this.x) * this.scale, y: this.height / 2 - (y - this.y) * this.scale };
  }

  // Lets a context draw in metres, y up.
  apply(context, ratio) {
    const k = ratio * this.scale;
    context.setTransform(k, 0, 0, -k, ratio * this.width / 2 - k * this.x, ratio * this.height / 2 + k * this.y);
  }
}
