# SPDX-License-Identifier: MIT
"""The style sheet of the report: readable on a screen and on paper.

Sections, tables and figures are numbered by the sheet's counters.
"""

STYLE = """
:root { --ink: #222; --quiet: #6b6b6b; --line: #ddd; --tint: #f5f7f9; --accent: #0072b2; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 60rem; padding: 2rem 1.5rem 4rem; color: var(--ink);
  font: 15px/1.5 "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; background: #fff;
  counter-reset: section table figure; }
header { border-bottom: 3px solid var(--accent); margin-bottom: 1.5rem; }
h1 { font-size: 1.8rem; line-height: 1.2; margin: 0 0 .3rem; overflow-wrap: anywhere; }
h2 { font-size: 1.25rem; margin: 2.4rem 0 .7rem; }
h2::before { counter-increment: section; content: counter(section) "\\2002"; color: var(--accent); }
p { margin: .3rem 0 .8rem; }
.quiet { color: var(--quiet); }
.figures { display: grid; gap: .6rem;
  grid-template-columns: repeat(auto-fit, minmax(10rem, 1fr)); }
.figures div { background: var(--tint); border-radius: 4px; padding: .6rem .8rem; }
.figures strong { display: block; font-size: 1.2rem; white-space: nowrap; }
.figures span { color: var(--quiet); font-size: .85rem; }
.warnings { border-left: 4px solid #d55e00; background: #fdf3ec; padding: .6rem 1rem .2rem;
  margin-top: 1.2rem; }
.warnings ul { margin: .2rem 0 .6rem; padding-left: 1.2rem; }
.wide { overflow-x: auto; margin: 1.1rem 0; }
.wide p { font-size: .85rem; margin: .2rem 0 0; }
table { border-collapse: collapse; font-size: .88rem; min-width: 50%; }
caption { text-align: left; padding: 0 0 .3rem; white-space: nowrap; }
caption::before { counter-increment: table; content: "Table " counter(table) ".\\2002";
  font-weight: 600; }
th, td { text-align: left; padding: .3rem .7rem; border-bottom: 1px solid var(--line);
  vertical-align: bottom; }
th { border-bottom: 2px solid var(--ink); font-weight: 600; }
table.dense { font-size: .8rem; }
.dense th, .dense td { padding: .25rem .45rem; }
.n { text-align: right; font-variant-numeric: tabular-nums; }
td.n { white-space: nowrap; }
figure { margin: 1.6rem 0; }
img { max-width: 100%; height: auto; display: block; }
figcaption { font-size: .88rem; margin-top: .3rem; color: var(--quiet); }
figcaption strong { color: var(--ink); }
figcaption::before { counter-increment: figure; content: "Figure " counter(figure) ".\\2002";
  font-weight: 600; color: var(--ink); }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.2rem; margin: 0; }
dt { color: var(--quiet); }
dd { margin: 0; overflow-wrap: anywhere; }
.columns { display: flex; flex-wrap: wrap; gap: 0 2.5rem; align-items: flex-start; }
.columns table { min-width: 0; }
@media print {
  body { max-width: none; padding: 0; font-size: 10pt; }
  figure, tr, .figures, .warnings { break-inside: avoid; }
  .wide:not(.long) { break-inside: avoid; }
  thead { display: table-header-group; }
  h2, caption { break-after: avoid; }
  figure img { max-height: 22cm; }
  .figures div, .warnings { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  .wide { overflow: visible; }
}
@page { size: A4; margin: 18mm 16mm; @bottom-right { content: counter(page); font-size: 8pt; } }
"""
