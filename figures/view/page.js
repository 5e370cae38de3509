// The page: a load, a pair, what moves; and what each of them changes.
const TYPES = {f4: Float32Array, f8: Float64Array, i1: Int8Array, u1: Uint8Array, u2: Uint16Array, i2: Int16Array}

function decode(value) {
  if (Array.isArray(value)) return value.map(decode)
  if (!value || typeof value != "object") return value
  if (!value.base64) return Object.fromEntries(Object.entries(value).map(([key, each]) => [key, decode(each)]))
  return new TYPES[value.type](Uint8Array.from(atob(value.base64), (c) => c.charCodeAt(0)).buffer)
}

const data = decode(JSON.parse(document.getElementById("data").textContent))
const at = (id) => document.getElementById(id)
data.largest = Math.max(...data.frames.map((frame) => Math.abs(frame.force))) || 1
const {frames, pairs, axis, legs} = data, values = frames.map((frame) => frame.value)
const slider = at("load"), which = at("pair"), motion = at("motion"), button = at("play")
const calm = matchMedia("(prefers-reduced-motion: reduce)").matches
const FIRST = "var(--first)", SECOND = "var(--second)", OTHERS = "var(--others)", DASHES = ["", "7 4", "2 3", "9 3 2 3"]
let here = data.opens, chosen = null, asked = false, phase = 0, last = null, playing = null

// The two eigenvalues of a pair from their mean and the square of their difference.
function two(mean, square) {
  const half = 0.5 * Math.sqrt(Math.abs(square))
  return square < 0 ? [[mean, half], [mean, -half]] : [[mean - half, 0], [mean + half, 0]]
}

// sqrt(re + i im), with a real part that is not negative: a frequency and a rate.
function root([re, im]) {
  const size = Math.hypot(re, im), along = Math.sqrt(Math.max(0, 0.5 * (size + re)))
  return [along, (im < 0 ? -1 : 1) * Math.sqrt(Math.max(0, 0.5 * (size - re)))]
}

const members = (pair, k = here) => two(pair.mean[k], pair.square[k])
const growth = (pair, k = here) => pair.square[k] < 0 ? 2 * root(members(pair, k)[0])[1] : 0
const known = (pair, k = here) => pair != null && Number.isFinite(pair.mean[k])
const value = (k) => axis && `${axis.name} = ${digits(values[k], 5)}`
const exponential = (rate) => `exp(${digits(rate, 3)} t)`

// A curve of a quantity of each leg of the path, dashed on the ways back.
const overLoad = (quantity, style) => legs.map((leg, n) => ({x: leg.map((k) => values[k]), y: leg.map(quantity),
  "stroke-dasharray": DASHES[n % 4], ...style}))
const curve = (pair, quantity, style) => pair.curves.map(({load, mean, square}, n) => ({x: load,
  y: Array.from(load, (_, k) => quantity(mean[k], square[k])), "stroke-dasharray": DASHES[n % 4], ...style}))

const plots = {}, OVER_LOAD = ["count", "growth", "real", "imaginary"]
function make(id, ...rest) {
  if (at(id)) plots[id] = new Plot(at(id), ...rest)
  return plots[id]
}

function makePlots() {
  let highest = 0, rate = 0
  for (const {re, im} of frames) re.forEach((each, n) => {
    const [frequency, growing] = root([each, im[n]])
    highest = Math.max(highest, frequency)
    rate = Math.max(rate, growing)
  })
  const high = 1.25 * rate || 0.05 * highest
  make("plane", ["frequency Re ω", "rate Im ω"], [0, 1.03 * highest], [-high, high]).whenPressed((_, px, py) => {
    let closest = null, least = 25
    for (const pair of pairs) for (const member of known(pair) ? members(pair) : []) {
      const [x, y] = plots.plane.place(...root(member)), away = Math.hypot(x - px, y - py)
      if (away < least) [closest, least] = [pair, away]
    }
    if (closest) choose(closest)
  })
  if (axis) {
    make("paths", ["Re λ", "Im λ"], [0, 1], [-1, 1])
    const x = range(values, 0.02), largest = Math.max(1, ...frames.map((frame) => frame.pairs))
    const rates = frames.flatMap((frame) => [frame.rate, frame.undamped])
    make("count", [axis.name, "complex pairs"], x, [0, 1.12 * largest], {whole: true})
    make("growth", [axis.name, "growth rate of D"], x, rates.some((rate) => rate) ? range([0, ...rates], 0.08) : [0, 1])
    make("real", [axis.name, "Re λ"], x, [0, 1])
    make("imaginary", [axis.name, "Im λ"], x, [-1, 1])
    for (const id of OVER_LOAD) plots[id].whenPressed((x) => go(nearest(x)), true)
  }
  if (data.cycle) {
    const {moved, force} = data.cycle
    make("cycle", ["displacement of the upper layer", "Fₓ"], range(moved, 0.05), range(force, 0.05))
  }
  if (data.series) drawRun(data.series.time, Array.from(data.series.msd, Math.log10))
}

// D(t), from the noise on; the slope lies beside D, a decade and a half above the noise.
function drawRun(time, logs) {
  const early = logs.slice(0, Math.ceil(logs.length / 4)).sort((a, b) => a - b), noise = early[early.length >> 1]
  const rate = frames[frames.length - 1].undamped / Math.LN10
  const span = range(logs.filter((each) => each > noise - 2), 0.05)
  const plot = make("run", ["time t", "D(t)"], range(time, 0), span, {log: true})
  plot.lines = [{x: time, y: logs, stroke: SECOND, "stroke-width": 1.5}]
  if (rate) plot.lines.push({x: time, y: Array.from(time, (t) => noise + 1.5 + rate * (t - time[0])), stroke: FIRST,
                             "stroke-width": 1.5, "stroke-dasharray": DASHES[1]})
  plot.draw()
}

// Of the loads closest to a place on the axis, the one that follows the present one first along the path.
function nearest(x) {
  const away = values.map((each) => Math.abs(each - x)), least = Math.min(...away) * (1 + 1e-9) + 1e-300
  const same = away.flatMap((each, k) => each <= least ? [k] : [])
  return same.reduce((a, b) => Math.abs(b - here) < Math.abs(a - here) ? b : a)
}

const COLOURS = [FIRST, SECOND]
const dot = (x, y, fill, r = 5, style = {}) => ({x, y, r, fill, ...style})

function drawPlots() {
  drawPlane()
  if (axis) {
    drawLoad()
    if (chosen) drawPair()
    for (const id of OVER_LOAD) plots[id].at = values[here]
  }
  if (plots.cycle) drawCycle()
  for (const [id, plot] of Object.entries(plots)) if (id != "run") plot.draw()
}

// All eigenvalues of a load; those of complex pairs can be pressed.
function drawPlane() {
  const frame = frames[here], omega = (member, ...style) => dot(...root(member), ...style)
  const choices = pairs.filter((pair) => pair != chosen && known(pair) && growth(pair)).flatMap((pair) => members(pair))
  plots.plane.dots = [
    ...Array.from(frame.re, (re, n) => omega([re, frame.im[n]], OTHERS, 2.6)),
    ...choices.map((member) => omega(member, OTHERS, 4, {class: "choice", title: "a complex pair: press it"})),
    ...known(chosen) ? members(chosen).map((member, n) => omega(member, COLOURS[n], 6, {class: "chosen"})) : []]
}

// Number of pairs and growth rates over the load.
function drawLoad() {
  const frame = frames[here], rate = (mean, square) => square <= 0 ? 2 * root(two(mean, square)[0])[1] : NaN
  plots.count.lines = legs.map((leg, n) =>
    steps(leg.map((k) => values[k]), leg.map((k) => frames[k].pairs), DASHES[n % 4]))
  plots.count.dots = [dot(frame.value, frame.pairs, FIRST)]
  plots.growth.lines = [
    ...pairs.flatMap((each) => curve(each, rate, {stroke: OTHERS, "stroke-width": 1, opacity: 0.7})),
    ...chosen ? curve(chosen, rate, {stroke: FIRST, "stroke-width": 2.2}) : [],
    ...data.dissipative ? overLoad((k) => frames[k].rate, {stroke: SECOND, "stroke-width": 2.2}) : []]
  plots.growth.dots = [
    ...known(chosen) && growth(chosen) ? [dot(frame.value, growth(chosen), FIRST)] : [],
    ...data.dissipative ? [dot(frame.value, frame.rate, SECOND)] : []]
}

// The chosen pair in the plane of lambda, and both of its parts over the load.
function drawPair() {
  const now = known(chosen) ? members(chosen) : []
  const part = (n, which) => (mean, square) => two(mean, square)[n][which]
  const along = (n, which) =>
    chosen.curves.map(({mean, square}) => Array.from(mean, (m, k) => part(n, which)(m, square[k])))
  plots.paths.x = range([...along(0, 0), ...along(1, 0)].flat(), 0.1)
  plots.paths.y = range([...along(0, 1), ...along(1, 1)].flat(), 0.15)
  plots.paths.lines = COLOURS.flatMap((stroke, n) => {
    const [x, y] = [along(n, 0), along(n, 1)]
    return x.map((each, leg) => ({x: each, y: y[leg], stroke, "stroke-width": 1.8}))
  })
  plots.paths.dots = now.map((member, n) => dot(...member, COLOURS[n], 6))
  for (const [id, which] of [["real", 0], ["imaginary", 1]]) {
    plots[id].y = which ? plots.paths.y : plots.paths.x
    plots[id].lines = COLOURS.flatMap((stroke, n) => curve(chosen, part(n, which), {stroke, "stroke-width": 1.8}))
    plots[id].dots = now.map((member, n) => dot(values[here], member[which], COLOURS[n]))
  }
}

function drawCycle() {
  const {moved, force} = data.cycle
  plots.cycle.lines = legs.map((leg, n) => ({x: leg.map((k) => moved[k]), y: leg.map((k) => force[k]), stroke: OTHERS,
    "stroke-width": 2, "stroke-dasharray": DASHES[n % 4]}))
  plots.cycle.dots = [dot(moved[here], force[here], FIRST)]
}

// A number that changes half way between two loads.
function steps(x, y, dash) {
  const line = {x: [], y: [], stroke: FIRST, "stroke-width": 1.8, "stroke-dasharray": dash}
  x.forEach((each, k) => {
    line.x.push(k ? 0.5 * (x[k - 1] + each) : each, k + 1 < x.length ? 0.5 * (each + x[k + 1]) : each)
    line.y.push(y[k], y[k])
  })
  return line
}

function tell() {
  const frame = frames[here]
  at("verdict").className = frame.stable == null ? "unknown" : frame.stable ? "stable" : "unstable"
  const [first, ...rest] = frame.sentences
  at("where").textContent = axis ? value(here) : ""
  at("answer").textContent = first
  at("more").textContent = rest.join(" ")
  if (axis) {
    slider.value = here
    at("value").textContent = digits(frame.value, 5)
    slider.setAttribute("aria-valuetext", value(here))
  }
  const complex = pairs.filter((pair) => known(pair) && growth(pair)).sort((a, b) => growth(b) - growth(a))
  const listed = chosen && !complex.includes(chosen) ? [chosen, ...complex] : complex
  which.replaceChildren(...listed.map((pair) => new Option(name(pair), pairs.indexOf(pair), false, pair == chosen)))
  which.disabled = !listed.length
  const kinds = known(chosen) && growth(chosen) ? ["growing mode", "decaying mode"]
    : ["mode of the lower λ", "mode of the higher λ"]
  const options = known(chosen) ? kinds.map((kind, n) => new Option(`the ${kind} moves`, n)) : []
  const before = motion.value || (calm ? "still" : "0")
  motion.replaceChildren(...options, new Option("the packing is at rest", "still"))
  motion.value = options.length ? before : "still"
  at("members").textContent = describe()
}

// The chosen pair in a sentence.
function describe() {
  if (!chosen) return "No two eigenvalues are close to merging."
  if (!known(chosen)) return `No two modes at ${value(here)} have the shapes of the chosen pair.`
  const [[re, im], [other]] = members(chosen)
  const without = data.dissipative ? " without dissipation" : ""
  const grows = `D grows as ${exponential(growth(chosen))}${without}`
  const lone = axis && frames.every((_, k) => k == here || !known(chosen, k))  // its plots have a dot and no line
  const elsewhere = lone ? ` No two modes at another ${axis.name} of this page have the shapes of this pair.` : ""
  return (growth(chosen) ? `λ = ${digits(re, 5)} ± ${digits(im)} i: a complex pair. ${grows}.`
    : `λ = ${digits(re, 6)} and ${digits(other, 6)}: both real. Both modes oscillate.`) + elsewhere
}

function name(pair) {
  if (!known(pair)) return "the chosen pair: not at this load"
  const [[re, im], [other]] = members(pair)
  return growth(pair) ? `λ = ${digits(re)} ± ${digits(im, 3)} i, rate ${digits(growth(pair), 3)}`
    : `λ = ${digits(re, 5)} and ${digits(other, 5)}, real`
}

const canvas = new PackingCanvas(at("packing"), data, drawPacking)

function drawPacking() {
  const frame = frames[here], still = motion.value == "still" || !known(chosen)
  const shape = still ? null : chosen.shapes[here], n = data.radius.length, axes = data.dimension == 2 ? 3 : 6
  const reach = 0.45 * Math.max(...data.radius)
  if (!shape) return canvas.draw(frame, null)
  const complex = growth(chosen) > 0, second = motion.value == "1", size = axes * n
  const c = reach * shape.scale[complex ? 0 : Number(second)] * Math.cos(phase)
  const s = complex ? reach * shape.scale[1] * Math.sin(phase) * (second ? -1 : 1) : 0
  const from = !complex && second ? size : 0
  canvas.draw(frame, (row, k) => c * shape.rows[from + row * n + k] + s * shape.rows[size + row * n + k])
}

function show() {
  tell()
  drawPlots()
  drawPacking()
}

// The pair that grows fastest at this load, or one that is known here.
const fastest = () => pairs.filter((pair) => known(pair)).sort((a, b) => growth(b) - growth(a))[0]

function go(k) {
  here = Math.min(frames.length - 1, Math.max(0, k))
  if (!asked && !known(chosen)) chosen = fastest() ?? chosen
  show()
}

function choose(pair) {
  chosen = pair
  asked = true
  show()
}

function play(on) {
  clearInterval(playing)
  const pause = Math.max(80, Math.min(400, 9000 / frames.length))
  playing = on ? setInterval(() => here + 1 < frames.length ? go(here + 1) : play(false), pause) : null
  if (on) go(here + 1 < frames.length ? here + 1 : 0)
  button.textContent = on ? "❚❚" : "▶"
  button.setAttribute("aria-label", on ? "Pause" : "Play")
}

function turn(time) {
  if (motion.value != "still" && known(chosen)) {
    phase += last == null ? 0 : (time - last) / 400
    drawPacking()
  }
  last = time
  requestAnimationFrame(turn)
}

slider?.addEventListener("input", () => { play(false); go(Number(slider.value)) })
button?.addEventListener("click", () => play(!playing))
which.addEventListener("input", () => choose(pairs[which.value]))
motion.addEventListener("input", drawPacking)
document.addEventListener("keydown", (event) => {
  if (!axis || /SELECT/.test(event.target.tagName)) return
  const steps = {ArrowLeft: -1, ArrowRight: 1, Home: -frames.length, End: frames.length}
  const step = event.target == slider ? 0 : steps[event.key]
  if (step) { play(false); go(here + step) }
  if (event.key == " " && event.target != button) { event.preventDefault(); play(!playing) }
})
new ResizeObserver(drawPacking).observe(at("packing"))
makePlots()
chosen = fastest() ?? pairs[0] ?? null
show()
requestAnimationFrame(turn)
