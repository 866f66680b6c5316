"""The style of the page's own HTML; `pm-` keeps its classes apart from viser's."""

from __future__ import annotations

from proximity_monitor.display import fresh

STYLE = (
    f"<style>{fresh.STYLE}</style>"
    + """<style>
.pm { font: 13px/1.45 system-ui, sans-serif; color: inherit; margin: 0 10px 8px;
      font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
/* The folder above leaves much room below it, and the smallest window shows the first pair. */
.pm-list { margin-top: -9px; }
/* The panel is as wide as its widest content, so a long line must not count. */
.pm-wide { contain: inline-size; overflow-x: auto; }
.pm-line { display: flex; align-items: center; gap: 8px; contain: inline-size; }
/* data-pm: the page's script marks these elements. */
[data-pm=hidden] { display: none; }
[data-pm=pinned] { position: sticky; top: 0; z-index: 5; background: var(--mantine-color-body); }
/* In a box with hidden overflow it would not stick. */
[data-pm=around-pinned] { overflow: clip !important; }
.pm-cut { flex: 1; min-width: 0; overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
.pm-dim { opacity: .62; }
.pm-small { font-size: 11.5px; }
.pm-pill { border-radius: 10px; padding: 1px 9px; font-weight: 600; color: #fff;
           white-space: nowrap; }
.pm-banner { border-radius: 6px; padding: 1px 10px; border: 2px solid; background: #fff;
             color: #222; line-height: 1.35; display: grid;
             grid: 1.35em 1.35em / auto minmax(0, 1fr) auto; column-gap: 8px;
             contain: inline-size; }
.pm-banner > * { grid-row: 1; }
.pm-banner .pm-both { grid-row: 1 / 3; overflow: hidden; }
.pm-banner .pm-figures { grid-area: 2 / 1 / 3 / 4; display: flex; gap: 4px; min-width: 0; }
.pm-figures .pm-cut { flex: 0 1 auto; }
.pm-banner b, .pm-banner .pm-dim { white-space: nowrap; }
.pm-table { width: 100%; border-collapse: collapse; }
.pm-table th { text-align: left; font-weight: 600; font-size: 11px; opacity: .65;
               padding: 2px 4px; border-bottom: 1px solid #8884; overflow-wrap: normal; }
.pm-table td { padding: 3px 4px; border-bottom: 1px solid #8882; vertical-align: top; }
.pm-table tr.pm-row { cursor: pointer; scroll-margin: 3em 0 .5em; }  /* below the pill */
.pm-table tr.pm-row:hover { background: #0072b214; }
.pm-table .pm-chosen { background: #0072b226; }
.pm-table .pm-num { text-align: right; white-space: nowrap; }
.pm-table .pm-group td { font-weight: 600; background: #8882; }
.pm-unproved { color: var(--pm-old, #b04e00); font-weight: 600; }
.pm-fault { border: 2px solid #b3261e; border-radius: 6px; padding: 6px 10px; color: #b3261e; }
.pm-over { position: fixed; left: 10px; bottom: 10px; padding: 3px 10px; border-radius: 6px;
           border: 1px solid #8886; background: #fffd; color: #222; pointer-events: none;
           font: 13px/1.45 system-ui, sans-serif; }
/* The room below the title of a folder that is closed: the list needs it. */
[data-pm=folder] > :last-child :empty { padding: 5px !important; }
.pm-on { white-space: nowrap; }
.pm-sign { font-weight: 700; white-space: nowrap; }
.pm-bar { position: relative; height: 4px; border-radius: 2px; background: #8883;
          margin-top: 3px; }
.pm-bar i { position: absolute; top: 0; bottom: 0; border-radius: 2px; min-width: 3px; }
.pm-bar u { position: absolute; top: -2px; bottom: -2px; width: 1px; background: #666; }
.pm-table .pm-press { white-space: nowrap; }
/* If a row has all words that it can have, they need more than one line. */
#pm-pairs .pm-on, .pm-num .pm-unproved { white-space: normal; }
/* What is below a text with room for so many lines stays in place; else a press might miss it. */
.pm-room { min-height: calc(1.45em * var(--lines)); }
.pm-press { cursor: pointer; text-decoration: underline dotted; opacity: .75; }
.pm-press:hover { opacity: 1; }
</style>"""
)
