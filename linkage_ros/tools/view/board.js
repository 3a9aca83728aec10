/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* The drawing under the hand: the linkage, its other assemblies, its centres, and what is wrong. */

const Board = (() => {
  const TALLEST = 640;
  const NEAR = 13; // pixels about a pin that are the pin's
  const NEAR_BY_TOUCH = 24;
  const [LETTERS, MOST_LINES, LINE] = [44, 4, 16]; // of what is said at a pin; a line in pixels
  const HIGH = 12; // pixels: the letters of a name
  const PALE = 0.22;
  const LOOKED_AT = 72; // poses, to see how far a linkage reaches
  const ALONG = 9; // pixels next to a bar that are the bar's

  /** Return a text in lines that are short enough for a narrow picture. */
  function folded(text) {
    const lines = [''];
    for (const word of text.split(' ')) {
      const line = lines[lines.length - 1];
      if (line && line.length + 1 + word.length > LETTERS) lines.push(word);
      else lines[lines.length - 1] = line ? `${line} ${word}` : word;
    }
    if (lines.length <= MOST_LINES) return lines;
    return [...lines.slice(0, MOST_LINES - 1), `${lines[MOST_LINES - 1]} …`];
  }

  class Drawing extends Picture.Canvas {
    constructor(canvas, linkage) {
      super(canvas, linkage);
      this.tallest = TALLEST;
      this.absent = 'the loops do not close at this input';
      this.shown = { ghosts: true, centres: false, names: true };
      this.ghosts = [];
      this.chosen = null; // name of a pin
      this.wrong = null; // { pin, text }
      this.read = null; // what the sensors read, as frames
    }

    /** Show another model; its other assemblies too, where it names them. */
    take(linkage) {
      this.linkage = linkage;
      this.curves = null;
      if (linkage.model.others) {
        this.ghosts = linkage.model.others.filter((other) => other.program)
          .map((other) => new Motion.Linkage({ ...linkage.model, program: other.program }));
      }
    }

    /** Fit the picture to all that the linkage, and its ghosts if they are shown, come to. */
    fit(ink) {
      if (!this.linkage.frameOfPicture) this.linkage.reached = this.reachOfAll();
      super.fit({ ...ink, ...this.words() });
    }

    /**
     * Return the corners of what comes by over the range of the input; null if that is nothing.
     *
     * The range is that in which the linkage is: in another one it may be elsewhere.
     */
    reachOfAll() {
      const { drawn: { shapes, size }, inputs } = this.linkage;
      const found = [Infinity, Infinity, -Infinity, -Infinity];
      const take = (linkage, ofGround) => {
        for (const { link, points } of shapes) {
          if ((link === 'ground') !== ofGround) continue;
          for (let i = 0; i < points.length; i += 2) {
            const [x, y] = linkage.place(link, points[i], points[i + 1]);
            [found[0], found[1]] = [Math.min(found[0], x), Math.min(found[1], y)];
            [found[2], found[3]] = [Math.max(found[2], x), Math.max(found[3], y)];
          }
        }
      };
      const [low, high] = this.linkage.range();
      let moves = false;
      for (const linkage of [this.linkage, ...(this.shown.ghosts ? this.ghosts : [])]) {
        const { now } = linkage;
        for (let i = 0; i <= LOOKED_AT; i++) {
          const value = i < LOOKED_AT ? low + ((high - low) * i) / (LOOKED_AT - 1) : inputs[0];
          linkage.now = linkage.motion([value, ...inputs.slice(1)]);
          if (!linkage.closed) continue;
          moves = true;
          take(linkage, false);
        }
        linkage.now = now;
      }
      if (!moves) return null;
      take(this.linkage, true);
      const edge = 3 * size;
      return [found[0] - edge, found[1] - edge, found[2] + edge, found[3] + edge];
    }

    paint() {
      if (!this.size) return;
      this.draw(0, 0, [0, 0]);
      const pen = this.canvas.getContext('2d');
      if (this.shown.ghosts) this.drawGhosts(pen);
      if (this.read) this.drawAside(pen, this.read);
      if (!this.linkage.closed) return;
      if (this.shown.centres) this.drawCentres(pen);
      this.drawPins(pen);
      this.drawWrong(pen);
    }

    /** Draw the moving links of another pose, pale. */
    drawAside(pen, linkage) {
      const own = this.linkage;
      this.linkage = linkage;
      pen.globalAlpha = PALE;
      for (const shape of own.drawn.shapes) {
        if (shape.link !== 'ground') this.drawShape(pen, shape, 0);
      }
      pen.globalAlpha = 1;
      this.linkage = own;
    }

    drawGhosts(pen) {
      for (const ghost of this.ghosts) {
        ghost.model = { ...ghost.model, drawn: this.linkage.drawn };
        ghost.seek(this.linkage.inputs);
        if (ghost.closed) this.drawAside(pen, ghost);
      }
    }

    drawCentres(pen) {
      const { width, tall } = this.size;
      pen.strokeStyle = pen.fillStyle = Looks.colour(1, this.ink.edge);
      pen.font = this.font(11);
      pen.lineWidth = 1.5;
      for (const link of this.linkage.model.links) {
        const centre = this.linkage.centre(link);
        if (!centre) continue;
        const [x, y] = this.toPixel(centre);
        if (x < 0 || y < 0 || x > width || y > tall) continue;
        pen.beginPath();
        for (const [dx, dy] of [[-5, -5], [5, 5], [-5, 5], [5, -5]]) {
          if (dx < 0) pen.moveTo(x + dx, y + dy);
          else pen.lineTo(x + dx, y + dy);
        }
        pen.stroke();
        // To its left: where it is a pin, that one's name is on the right.
        this.drawName(pen, link, x - 8 - pen.measureText(link).width, y - 6);
      }
    }

    drawPins(pen) {
      pen.font = this.font(12);
      for (const pin of this.linkage.pins()) {
        const [x, y] = this.toPixel(pin.place);
        if (pin.name === this.chosen) {
          pen.beginPath();
          pen.arc(x, y, NEAR - 3, 0, 2 * Math.PI);
          pen.lineWidth = 2;
          pen.strokeStyle = this.ink.chosen;
          pen.stroke();
        }
        if (this.shown.names) this.drawName(pen, pin.name, x + 9, y - 9);
      }
    }

    /** Write a name within the picture, with an edge of paper that parts it from what it is on. */
    drawName(pen, name, x, y) {
      const { width, tall } = this.size;
      const left = Math.min(x, width - pen.measureText(name).width - 2);
      if (left < 0 || x > width || y < HIGH || y > tall) return;
      pen.lineWidth = 3;
      pen.strokeStyle = this.ink.paper;
      pen.strokeText(name, left, y);
      pen.fillStyle = this.ink.edge;
      pen.fillText(name, left, y);
    }

    /** Say what is wrong at the pin or link that it concerns. */
    drawWrong(pen) {
      if (!this.wrong) return;
      const { pin, text } = this.wrong;
      const at = this.linkage.pins().find((each) => each.name === pin || each.link === pin);
      if (!at) return;
      const [x, y] = this.toPixel(at.place);
      pen.beginPath();
      pen.arc(x, y, NEAR, 0, 2 * Math.PI);
      pen.lineWidth = 2.5;
      pen.strokeStyle = '#d55e00';
      pen.stroke();
      pen.font = this.font(12);
      const lines = folded(text);
      const wide = Math.max(...lines.map((line) => pen.measureText(line).width)) + 12;
      const high = lines.length * LINE + 8;
      const left = Math.max(4, Math.min(x - wide / 2, this.size.width - wide - 4));
      const top = y > high + 24 ? y - high - 20 : y + 22;
      pen.fillStyle = this.ink.paper;
      pen.fillRect(left, top, wide, high);
      pen.lineWidth = 1.5;
      pen.strokeRect(left, top, wide, high);
      pen.fillStyle = this.ink.text;
      lines.forEach((line, i) => pen.fillText(line, left + 6, top + (i + 1) * LINE));
    }

    font(size) {
      return `${size}px ${getComputedStyle(document.body).fontFamily}`;
    }

    words() {
      const { paper, ink, link } = Page.colours('link');
      return { paper, text: ink, chosen: link };
    }

    /** Return the pin under a pixel; null if there is none. */
    pinAt(pixel, coarse) {
      if (!this.linkage.closed) return null;
      let found = null;
      let nearest = coarse ? NEAR_BY_TOUCH : NEAR;
      for (const pin of this.linkage.pins()) {
        const [x, y] = this.toPixel(pin.place);
        const far = Math.hypot(x - pixel[0], y - pixel[1]);
        if (far <= nearest) [found, nearest] = [pin, far];
      }
      return found;
    }

    /** Return the moving link whose drawing lies under a pixel; the topmost one. */
    linkAt(pixel) {
      if (!this.linkage.closed) return null;
      const pen = this.canvas.getContext('2d');
      const { ratio } = this.size;
      for (const shape of [...this.linkage.drawn.shapes].reverse()) {
        if (shape.link === 'ground' || shape.radius || !shape.points.length) continue;
        const path = new Path2D();
        for (let i = 0; i < shape.points.length; i += 2) {
          const place = this.linkage.place(shape.link, shape.points[i], shape.points[i + 1]);
          path.lineTo(...this.toPixel(place));
        }
        if (shape.closed) path.closePath();
        pen.lineWidth = ALONG;
        const [x, y] = [pixel[0] * ratio, pixel[1] * ratio];
        if (pen.isPointInPath(path, x, y) || pen.isPointInStroke(path, x, y)) return shape.link;
      }
      return null;
    }
  }

  class Spatial extends Space.drawn(Drawing) {
    reachOfAll() {
      return null; // it is seen from wherever the camera is
    }

    drawAside() {} // it has one assembly

    linkAt() {
      return null; // its points are taken
    }
  }

  return { Drawing, Spatial };
})();
