// The packing on a canvas: disks, or spheres that a pointer turns, with force chains, walls and the load.
class PackingCanvas {
  constructor(canvas, data, onturn) {
    Object.assign(this, {canvas, data, turned: [0.5, 0.32], sprites: {}})
    if (data.dimension == 3) {
      canvas.style.cursor = "grab"
      canvas.style.touchAction = "pan-y"
      canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId))
      canvas.addEventListener("pointermove", (event) => {
        if (!event.buttons) return
        this.turned[0] -= event.movementX / 150
        this.turned[1] = Math.min(1.5, Math.max(-1.5, this.turned[1] + event.movementY / 150))
        onturn()
      })
    }
  }

  // Screen coordinates (right, up) and depth towards the viewer, before they are scaled.
  seen(x, y, z) {
    if (this.data.dimension == 2) return [x, y, 0]
    const [a, e] = this.turned, along = Math.cos(a) * x + Math.sin(a) * y, away = -Math.sin(a) * x + Math.cos(a) * y
    return [along, away * Math.sin(e) + z * Math.cos(e), z * Math.sin(e) - away * Math.cos(e)]
  }

  fit() {
    const ratio = window.devicePixelRatio || 1, {clientWidth: width, clientHeight: height} = this.canvas
    if (this.canvas.width != Math.round(width * ratio) || this.canvas.height != Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio)
      this.canvas.height = Math.round(height * ratio)
    }
    const pen = this.canvas.getContext("2d")
    pen.setTransform(ratio, 0, 0, ratio, 0, 0)
    pen.clearRect(0, 0, width, height)
    const [low, high] = this.data.extent
    let [left, right, bottom, top] = [low[0], high[0], low[1], high[1]]
    if (this.data.dimension == 3) {
      const corners = this.data.corners.map((corner) => this.seen(...corner)), r = 0.7 * Math.max(...this.data.radius)
      left = Math.min(...corners.map((c) => c[0])) - r
      right = Math.max(...corners.map((c) => c[0])) + r
      bottom = Math.min(...corners.map((c) => c[1])) - r
      top = Math.max(...corners.map((c) => c[1])) + r
    }
    this.scale = Math.min(width / (right - left), height / (top - bottom))
    this.shift = [0.5 * (width - this.scale * (left + right)), 0.5 * (height + this.scale * (bottom + top))]
    Object.assign(this, {pen, width, height})
  }

  at(point) {
    return [this.shift[0] + this.scale * point[0], this.shift[1] - this.scale * point[1]]
  }

  // moved(axis, particle): displacement, length; null if nothing moves
  draw(frame, moved) {
    this.fit()
    const {pen, data, scale} = this, three = data.dimension == 3
    const by = (axis, k) => moved && k >= 0 ? moved(axis, k) : 0
    if (!three) this.clipSides()
    if (three) this.box()
    const shapes = []
    for (let n = 0; n < frame.disk.length; n++) {
      const k = frame.disk[n], shift = (axis) => axis < data.dimension ? by(axis, k) : 0
      const p = [0, 1, 2].map((axis) => frame.place[3 * n + axis] + shift(axis))
      const middle = this.seen(...p)
      shapes.push([middle[2], () => three ? this.sphere(frame, k, p, middle, by) : this.disk(frame, k, middle, by)])
    }
    const widest = 0.5 * Math.min(...data.radius) * (three ? 0.6 : 1)
    for (let n = 0; n < frame.i.length; n++) {
      const ends = this.bar(frame, n, by).map((end) => this.seen(...end))
      shapes.push([three ? 0.5 * (ends[0][2] + ends[1][2]) + 0.1 : 1, () => {
        pen.strokeStyle = data.colours[Math.min(255, Math.max(0, frame.share[n]))]
        pen.lineWidth = Math.max(0.4, widest * frame.width[n] * scale)
        pen.lineCap = "round"
        pen.beginPath()
        pen.moveTo(...this.at(ends[0]))
        pen.lineTo(...this.at(ends[1]))
        pen.stroke()
      }])
    }
    shapes.sort((a, b) => a[0] - b[0]).forEach(([, shape]) => shape())
    if (!three) {
      pen.restore()
      this.walls()
    }
    if (frame.force != null) this.load(frame.force)
  }

  // Both ends of the bar of a contact; that on a wall slides along the wall.
  bar(frame, n, by) {
    const bars = frame.bars.slice(6 * n, 6 * n + 6), three = [0, 1, 2], dimension = this.data.dimension
    const shift = (k) => three.map((axis) => axis < dimension ? by(axis, k) : 0)
    const near = shift(frame.i[n]), branch = three.map((axis) => bars[3 + axis] - bars[axis])
    const dot = (a, b) => three.reduce((sum, axis) => sum + a[axis] * b[axis], 0)
    const into = dot(near, branch) / dot(branch, branch)
    const far = frame.j[n] < 0 ? three.map((axis) => near[axis] - into * branch[axis]) : shift(frame.j[n])
    return [three.map((axis) => bars[axis] + near[axis]), three.map((axis) => bars[3 + axis] + far[axis])]
  }

  clipSides() {
    const {pen, data} = this, [low, high] = data.extent, a = this.at(low), b = this.at(high)
    pen.save()
    if (!data.periodic) return
    pen.setLineDash([4, 4])
    pen.strokeStyle = getComputedStyle(this.canvas).color
    pen.lineWidth = 0.8
    for (const x of [a[0], b[0]]) { pen.beginPath(); pen.moveTo(x, a[1]); pen.lineTo(x, b[1]); pen.stroke() }
    pen.setLineDash([])
    pen.beginPath()
    pen.rect(a[0], b[1], b[0] - a[0], a[1] - b[1])
    pen.clip()
  }

  disk(frame, k, middle, by) {
    const {pen, data, scale} = this, [x, y] = this.at(middle), r = data.radius[k] * scale
    pen.fillStyle = data.faces[frame.face[k]]
    pen.strokeStyle = data.edge
    pen.lineWidth = 0.7
    pen.beginPath()
    pen.arc(x, y, r, 0, 2 * Math.PI)
    pen.fill()
    pen.stroke()
    const turn = frame.angle[k] + by(2, k) / data.radius[k], s = -Math.sin(turn), c = Math.cos(turn)
    pen.strokeStyle = data.ink
    pen.lineWidth = 1.2
    pen.beginPath()
    pen.moveTo(x + 0.6 * r * s, y - 0.6 * r * c)
    pen.lineTo(x + 0.95 * r * s, y - 0.95 * r * c)
    pen.stroke()
  }

  sphere(frame, k, p, middle, by) {
    const {pen, data, scale} = this, [x, y] = this.at(middle), r = data.radius[k]
    pen.globalAlpha = 0.72
    pen.drawImage(this.sprite(data.faces[frame.face[k]]), x - r * scale, y - r * scale, 2 * r * scale, 2 * r * scale)
    pen.globalAlpha = 1
    // a mark that turns with the sphere, on the side of the viewer: d = theta x e
    const [a, e] = this.turned, n = [Math.sin(a) * Math.cos(e), -Math.cos(a) * Math.cos(e), Math.sin(e)]
    const t = [3, 4, 5].map((axis) => by(axis, k) / r)
    const mark = [p[0] + r * (n[0] + t[1] * n[2] - t[2] * n[1]), p[1] + r * (n[1] + t[2] * n[0] - t[0] * n[2]),
                  p[2] + r * (n[2] + t[0] * n[1] - t[1] * n[0])]
    pen.fillStyle = data.ink
    pen.beginPath()
    pen.arc(...this.at(this.seen(...mark)), 1.6, 0, 2 * Math.PI)
    pen.fill()
  }

  // A lit sphere of a colour, drawn once.
  sprite(colour) {
    if (!this.sprites[colour]) {
      const made = document.createElement("canvas"), pen = made.getContext("2d")
      made.width = made.height = 128
      pen.fillStyle = colour
      pen.beginPath()
      pen.arc(64, 64, 63, 0, 2 * Math.PI)
      pen.fill()
      const light = pen.createRadialGradient(46, 40, 4, 64, 64, 64)
      light.addColorStop(0, "rgba(255,255,255,0.75)")
      light.addColorStop(0.5, "rgba(255,255,255,0)")
      light.addColorStop(1, "rgba(20,30,45,0.6)")
      pen.fillStyle = light
      pen.fill()
      this.sprites[colour] = made
    }
    return this.sprites[colour]
  }

  walls() {
    const {pen, data} = this, [low, high] = data.extent
    pen.fillStyle = data.wall
    for (const {axis, sign, place} of data.walls) {
      const from = [...low], to = [...high]
      if (sign > 0) to[axis] = place
      else from[axis] = place
      const a = this.at(from), b = this.at(to)
      pen.fillRect(a[0], b[1], b[0] - a[0], a[1] - b[1])
    }
  }

  // Edges of the box of spheres, and its walls.
  box() {
    const {pen, data} = this, corner = (k) => this.at(this.seen(...data.corners[k]))
    for (const {axis, sign} of data.walls) {
      const face = [[0, 0], [1, 0], [1, 1], [0, 1]].map(([a, b]) =>
        (sign > 0 ? 0 : 1) << axis | a << (axis + 1) % 3 | b << (axis + 2) % 3)
      pen.beginPath()
      face.forEach((k) => pen.lineTo(...corner(k)))
      pen.closePath()
      pen.globalAlpha = 0.25
      pen.fillStyle = data.wall
      pen.fill()
      pen.globalAlpha = 1
    }
    pen.strokeStyle = data.edge
    pen.lineWidth = 0.8
    for (let k = 0; k < 8; k++) for (let axis = 0; axis < 3; axis++) if (!(k >> axis & 1)) {
      pen.beginPath()
      pen.moveTo(...corner(k))
      pen.lineTo(...corner(k | 1 << axis))
      pen.stroke()
    }
  }

  // The arrow of the shear force above the packing, as long as its share of the largest force of the page.
  load(force) {
    const {pen, data} = this, [low, high] = data.extent
    const [middle, above] = this.at([0.5 * (low[0] + high[0]), high[1]]), y = above + 9
    const reach = 0.22 * (high[0] - low[0]) * this.scale * force / this.data.largest
    pen.strokeStyle = pen.fillStyle = getComputedStyle(this.canvas).color
    pen.font = "italic 15px system-ui, sans-serif"
    pen.textAlign = reach < 0 ? "left" : "right"
    pen.fillText("Fₓ", middle - Math.sign(reach || 1) * 8, y + 5)
    pen.lineWidth = 2.5
    pen.beginPath()
    pen.moveTo(middle, y)
    pen.lineTo(middle + reach, y)
    pen.stroke()
    if (Math.abs(reach) < 4) return
    const tip = middle + reach, back = Math.sign(reach) * 9
    pen.beginPath()
    pen.moveTo(tip + 0.4 * back, y)
    pen.lineTo(tip - back, y - 5.5)
    pen.lineTo(tip - back, y + 5.5)
    pen.fill()
  }
}
