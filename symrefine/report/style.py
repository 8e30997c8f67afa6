"""How the page looks: on white, on paper, on a telephone."""

STYLE = """
:root {
  --ink: #1d2430; --soft: #3a4352; --pale: #5f6878; --rule: #e3e7ee; --wash: #f6f8fb; --blue: #0072b2;
  --sans: system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
  --mono: ui-monospace, SFMono-Regular, Menlo, Consolas, "DejaVu Sans Mono", monospace;
}
* { box-sizing: border-box; }
body { margin: 0; background: #fff; color: var(--ink); font: 16px/1.55 var(--sans); }
main { max-width: 1060px; margin: 0 auto; padding: 40px 28px 64px; }
.over { margin: 0 0 4px; color: var(--pale); font-size: 15px; overflow-wrap: anywhere; }
h1 { margin: 0; font-size: 44px; line-height: 1.15; letter-spacing: -.01em; }
h1 span { margin-left: 10px; color: var(--soft); font-size: 25px; font-weight: 500; letter-spacing: 0; }
.lead { max-width: 52em; margin: 10px 0 0; color: var(--soft); font-size: 18px; }
h2 { margin: 44px 0 6px; font-size: 21px; }
section > p { max-width: 54em; margin: 0 0 14px; color: var(--soft); }
figure { margin: 22px 0 0; }
figure img { display: block; width: 100%; height: auto; border: 1px solid var(--rule); border-radius: 10px; }
dl {
  display: flex; flex-wrap: wrap; gap: 8px 40px; margin: 20px 0 0; padding: 14px 20px;
  background: var(--wash); border-radius: 10px;
}
dt { color: var(--pale); font-size: 13px; }
dd { margin: 0; font-weight: 600; font-variant-numeric: tabular-nums; }
.wide { overflow-x: auto; }
table { width: 100%; border-collapse: collapse; font-size: 15px; font-variant-numeric: tabular-nums; }
th, td { padding: 7px 10px; border-bottom: 1px solid var(--rule); text-align: right; white-space: nowrap; }
th { padding-block: 4px; border-bottom-color: #c9d0db; color: var(--pale); font-size: 13px; font-weight: 500; }
th:nth-child(-n+3), td:nth-child(-n+3) { text-align: left; }
th:first-child, td:first-child { padding-left: 0; }
code, pre { font-family: var(--mono); font-size: 13.5px; }
.swatch {
  display: inline-block; min-width: 28px; padding: 0 7px; border-radius: 5px; color: #fff; font-size: 14px;
  text-align: center;
}
.bar {
  position: relative; display: inline-block; width: 120px; height: 10px; border-radius: 5px; background: #edf0f5;
  vertical-align: middle; overflow: hidden;
}
.bar i { position: absolute; inset: 0 auto 0 0; background: var(--blue); }
.bar::after { content: ""; position: absolute; inset: 0 auto 0 80%; width: 2px; background: var(--ink); }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(290px, 1fr)); gap: 8px 26px; }
.charts figure { margin: 6px 0 0; }
figcaption { margin-bottom: 2px; font-size: 14px; font-weight: 600; }
svg { display: block; width: 100%; max-width: 760px; height: auto; }
svg text { font: 13px var(--sans); font-variant-numeric: tabular-nums; }
pre {
  margin: 0 0 12px; padding: 14px 18px; background: var(--wash); border-radius: 10px; white-space: pre-wrap;
  overflow-wrap: anywhere;
}
.bars svg { min-width: 520px; }
.quiet { color: var(--pale); font-size: 14.5px; }
@media (max-width: 640px) {
  main { padding: 24px 16px 48px; }
  h1 { font-size: 34px; }
  h1 span { display: block; margin: 4px 0 0; font-size: 20px; }
}
@media print {
  main { max-width: none; padding: 0; }
  section, figure { break-inside: avoid; }
}
"""
