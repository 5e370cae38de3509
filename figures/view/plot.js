// A plot in SVG: axes with ticks, lines, dots, and a mark at the present load. Lengths are CSS pixels.
const MARGIN = {left: 56, right: 10, top: 8, bottom: 36}

function element(parent, name, attributes = {}, text = "") {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name)
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value)
  made.textContent = text
  parent.append(made)
  return made
}

const superscript = (power) => [...String(power)].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")
const digits = (x, count = 4) => String(Number(x.toPrecision(count))).replace("-", "−")

function range(values, margin, least = 0) {
  let low = Infinity, high = -Infinity
  for (const v of values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v) }
  if (low > high) return [-1, 1]
  const room = margin * (high - low) || 0.05 * Math.abs(high) || 1
  return [low - room - least, high + room + least]
}

function ticks([low, high], count) {
  const rough = (high - low) / Math.max(count, 1), unit = 10 ** Math.floor(Math.log10(rough))
  const step = [1, 2, 5, 10].map((m) => m * unit).find((each) => each >= rough)
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9)
  return Array.from({length: last - first + 1}, (_, k) => ({at: (first + k) * step, step}))
}

class Plot {
  // names: of both axes; log: y is a power of ten; whole: y counts
  constructor(host, names, x, y, {log = false, whole = false} = {}) {
    this.svg = element(host, "svg", {role: "img"})
    Object.assign(this, {host, names, x, y, log, whole, lines: [], dots: [], at: null})
    new ResizeObserver(() => this.draw()).observe(host)
  }

  place(x, y) {
    const {left, top, bottom} = MARGIN
    return [left + (x - this.x[0]) / (this.x[1] - this.x[0]) * this.wide,
            top + (this.y[1] - y) / (this.y[1] - this.y[0]) * this.high]
  }

  // Calls back with the place that is pressed, in units of the axes and in pixels.
  whenPressed(callback, drags) {
    const tell = (event) => {
      const box = this.svg.getBoundingClientRect(), px = event.clientX - box.left, py = event.clientY - box.top
      callback(this.x[0] + (px - MARGIN.left) / this.wide * (this.x[1] - this.x[0]), px, py)
    }
    this.svg.addEventListener("pointerdown", (event) => {
      if (drags) this.svg.setPointerCapture(event.pointerId)
      tell(event)
    })
    if (drags) this.svg.addEventListener("pointermove", (event) => { if (event.buttons) tell(event) })
    this.svg.style.cursor = drags ? "ew-resize" : "pointer"
  }

  draw() {
    const width = this.host.clientWidth, height = this.host.clientHeight
    if (width < 40 || height < 40) return
    this.wide = width - MARGIN.left - MARGIN.right
    this.high = height - MARGIN.top - MARGIN.bottom
    const svg = this.svg
    svg.replaceChildren()
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`)
    svg.setAttribute("aria-label", `${this.names[1]} over ${this.names[0]}`)
    const clip = `inside-${this.host.id}`
    const [low, high] = [this.place(this.x[0], this.y[0]), this.place(this.x[1], this.y[1])]
    element(element(svg, "clipPath", {id: clip}), "rect",
            {x: low[0] - 1, y: high[1] - 6, width: this.wide + 2, height: this.high + 12})
    this.axis(0, Math.floor(this.wide / 62))
    this.axis(1, Math.floor(this.high / 26))
    const inside = element(svg, "g", {"clip-path": `url(#${clip})`})
    if (this.at != null) {
      const x = this.place(this.at, 0)[0]
      element(inside, "line", {class: "mark", x1: x, x2: x, y1: low[1], y2: high[1]})
    }
    for (const {x, y, ...style} of this.lines) {
      let path = "", open = false
      for (let k = 0; k < x.length; k++) {
        if (Number.isFinite(x[k]) && Number.isFinite(y[k])) {
          const [px, py] = this.place(x[k], y[k])
          path += `${open ? "L" : "M"}${px.toFixed(2)} ${py.toFixed(2)}`
          open = true
        } else open = false
      }
      element(inside, "path", {d: path, fill: "none", ...style})
    }
    for (const {x, y, r, title, ...style} of this.dots) {
      if (!Number.isFinite(x) || !Number.isFinite(y)) continue
      const [cx, cy] = this.place(x, y), dot = element(inside, "circle", {cx, cy, r, ...style})
      if (title) element(dot, "title", {}, title)
    }
  }

  axis(number, count) {
    const span = number ? this.y : this.x, largest = Math.max(...span.map(Math.abs))
    let power = Math.floor(Math.log10(largest))
    power = this.log && number || (power > -4 && power < 5) ? 0 : power
    for (const {at, step} of ticks(span, count)) {
      if (number && (this.whole || this.log) && at % 1) continue
      const [px, py] = number ? this.place(this.x[0], at) : this.place(at, this.y[0])
      const text = this.log && number ? `10${superscript(at)}` : digits(Math.round(at / step) * step / 10 ** power, 6)
      if (number) {
        element(this.svg, "line", {class: at == 0 ? "grid zero" : "grid", x1: px, x2: px + this.wide, y1: py, y2: py})
        element(this.svg, "text", {x: px - 6, y: py + 4, "text-anchor": "end"}, text)
      } else {
        element(this.svg, "line", {class: "grid", x1: px, x2: px, y1: py, y2: py - this.high})
        element(this.svg, "text", {x: px, y: py + 15, "text-anchor": "middle"}, text)
      }
    }
    const name = this.names[number] + (power ? ` / 10${superscript(power)}` : "")
    const middle = [MARGIN.left + this.wide / 2, MARGIN.top + this.high / 2]
    const below = MARGIN.top + this.high + 31
    const place = number ? `translate(12 ${middle[1]}) rotate(-90)` : `translate(${middle[0]} ${below})`
    element(this.svg, "text", {class: "name", transform: place, "text-anchor": "middle"}, name)
  }
}
