// Hands the arrays of a load to Bokeh, as the slider moves; moves the disks along a mode.
const at = (id) => document.getElementById(id)
const slider = at("load"), choice = at("mode")
const packing = plots.find((plot) => plot.name == "packing")
const pair = [...document.querySelectorAll("[data-colour]")].map((each) => each.dataset.colour)
let frame = frames[slider.value], phase = 0, last = null

function place() {
  const n = frame.modes.length / 12, chosen = choice.value == "still" ? null : Number(choice.value)
  const from = (chosen || 0) * 6 * n, reach = chosen == null ? 0 : 0.48 * frame.radius.reduce((a, b) => Math.max(a, b))
  const c = reach * Math.cos(phase), s = reach * Math.sin(phase), v = frame.modes
  const moved = (row, k) => k < 0 ? 0 : c * v[from + row * n + k] + s * v[from + (3 + row) * n + k]
  const dx = (k) => moved(0, k), dy = (k) => moved(1, k)
  const {disk, i, j, radius} = frame
  const pixels = packing.inner_width / (packing.x_range.end - packing.x_range.start)
  const x = frame.x.map((x, k) => x + dx(disk[k])), y = frame.y.map((y, k) => y + dy(disk[k]))
  disks.data = {x, y, radius, face: frame.face}
  const turned = frame.angle.map((angle, k) => angle + moved(2, disk[k]) / radius[k])
  const along = (share) => x.map((x, k) => x - share * radius[k] * Math.sin(turned[k]))
  const up = (share) => y.map((y, k) => y + share * radius[k] * Math.cos(turned[k]))
  marks.data = {x0: along(0.55), y0: up(0.55), x1: along(0.95), y1: up(0.95)}
  chains.data = {
    x0: frame.x0.map((x, k) => x + dx(i[k])), y0: frame.y0.map((y, k) => y + dy(i[k])),
    x1: frame.x1.map((x, k) => x + dx(j[k] < 0 ? i[k] : j[k])), y1: frame.y1.map((y, k) => y + dy(j[k])),
    px: frame.width.map((width) => width * pixels), share: frame.share}
}

function show() {
  frame = frames[slider.value]
  const re = frame.pair.slice(0, 2), im = frame.pair.slice(2), two = frame.known ? pair : [null, null]
  others.data = {re: frame.re, im: frame.im}
  members.data = {re, im, colour: two}
  now.data = {fx: [frame.fx, frame.fx], real: re, imaginary: im, colour: two}
  here.data = {moved: [frame.moved], fx: [frame.fx]}
  const digits = (x) => Number(x.toPrecision(5))
  at("fx").textContent = digits(frame.fx)
  at("says").textContent = frame.verdict + " " + (
    !frame.known ? "No two modes of this load have the shapes of the pair that is drawn at others."
    : im[0] > 0 ? `The pair drawn here is complex: λ = ${digits(re[0])} ± ${digits(im[0])} i.`
    : `The pair drawn here is real: λ = ${digits(re[0])} and ${digits(re[1])}.`)
  const names = im[0] > 0 ? ["growing mode", "decaying mode"] : ["mode of the lower λ", "mode of the higher λ"]
  names.forEach((name, k) => choice.querySelector(`[value="${k}"]`).textContent = name)
  place()
}

function paint() {
  const style = getComputedStyle(document.body), ink = style.color, faint = style.getPropertyValue("--faint")
  for (const plot of plots) {
    for (const axis of [...plot.left, ...plot.below]) {
      if (axis.type == "ColorBar") axis.setv({title_text_color: ink, major_label_text_color: ink})
      else axis.setv({axis_label_text_color: ink, major_label_text_color: ink, axis_line_color: faint,
                      major_tick_line_color: faint, minor_tick_line_color: null, axis_label_text_font_style: "normal"})
    }
    for (const each of plot.center) if (each.type.endsWith("Grid")) each.setv({grid_line_color: faint})
  }
}

function turn(time) {
  if (choice.value != "still" && frame.known) {
    phase += last == null ? 0 : (time - last) / 400
    place()
  }
  last = time
  requestAnimationFrame(turn)
}

slider.addEventListener("input", show)
choice.addEventListener("input", place)
document.addEventListener("keydown", (event) => {
  const step = slider.hidden ? 0 : {ArrowLeft: -1, ArrowRight: 1}[event.key]
  if (!step || /INPUT|SELECT/.test(event.target.tagName)) return
  slider.value = Number(slider.value) + step
  show()
})
new ResizeObserver(place).observe(document.body)
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", paint)
paint()
show()
requestAnimationFrame(turn)
