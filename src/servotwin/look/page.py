"""A page of HTML that needs nothing but itself: readable on a phone and in print."""

from __future__ import annotations

from servotwin.text import escape

STYLE = """
:root{color-scheme:light;--ink:#1b1f24;--soft:#57606a;--line:#d0d7de;--wash:#f6f8fa;--blue:#0072b2}
*{box-sizing:border-box}
body{margin:0 auto;max-width:64rem;padding:1rem 1.2rem 4rem;background:#fff;color:var(--ink);
font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif}
td code{overflow-wrap:normal}
h1{font-size:1.7rem;line-height:1.25;margin:1rem 0 .3rem}h2{font-size:1.3rem;margin:2.6rem 0 .6rem;padding-top:.4rem;
border-top:2px solid var(--line)}h3{font-size:1.05rem;margin:1.6rem 0 .4rem}
p{margin:.5rem 0}a{color:var(--blue)}code{font-size:.9em;overflow-wrap:anywhere}.lead{color:var(--soft)}
.note{border-left:4px solid #d55e00;background:#fff6ef;padding:.5rem .9rem;margin:1rem 0}
.numbers{display:grid;grid-template-columns:repeat(auto-fit,minmax(13rem,1fr));gap:.8rem;padding:0;margin:1rem 0;
list-style:none}
.numbers li{border:1px solid var(--line);border-radius:8px;padding:.6rem .8rem;background:var(--wash);font-size:.9rem}
.numbers b{display:block;font-size:1.35rem;color:var(--blue);font-variant-numeric:tabular-nums}
nav ol{columns:2;column-gap:2rem;margin:.4rem 0}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,26rem),1fr));gap:1rem;align-items:start}
figure{margin:.8rem 0;padding:.6rem;border:1px solid var(--line);border-radius:8px;break-inside:avoid;min-width:0}
figure>div{overflow-x:auto}figure img{display:block;max-width:100%;height:auto;margin:0 auto}
figure.wide img.drawing{width:var(--w);max-width:max(100%,40rem)}
figcaption{font-size:.9rem;color:var(--soft);margin-top:.4rem}figcaption b{color:var(--ink)}
img.formula{vertical-align:middle;max-width:none;height:auto}.formulas{overflow-x:auto;padding:.3rem 0}
.formulas p{white-space:nowrap;margin:.5rem 0}.formulas span{color:var(--soft);font-size:.85rem;padding-left:.8rem}
.scroll{overflow-x:auto;margin:.8rem 0}table{border-collapse:collapse;font-size:.86rem;width:100%}
caption{text-align:left;color:var(--soft);padding:.3rem 0;font-size:.9rem}
th,td{padding:.3rem .55rem;border-bottom:1px solid var(--line);text-align:left;vertical-align:top}
th{background:var(--wash);font-weight:600}td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;
white-space:nowrap}th.n{white-space:normal}
.measured,.identified{color:#00664a;font-weight:600}.datasheet,.literature{color:#005a8d;font-weight:600}
.assumed{color:#a34700;font-weight:600}footer{margin-top:3rem;color:var(--soft);font-size:.85rem}
@media(max-width:40rem){body{font-size:15px;padding:.6rem .8rem 3rem}nav ol{columns:1}}
@media print{body{max-width:none;font-size:9.5pt;padding:0}h2{break-after:avoid}.scroll,figure>div,.formulas{overflow:
visible}.figures{grid-template-columns:1fr 1fr}tr{break-inside:avoid}table{font-size:7.5pt}
figure.wide img.drawing{max-width:100%}a{color:inherit;text-decoration:none}}
"""


def document(title: str, body: str, *, style: str = "") -> str:
    """Return a whole page.

    Parameters
    ----------
    title : str
        Plain words.
    body : str
        HTML.
    style : str
        Further CSS.

    Examples
    --------
    >>> document("a < b", "<p>text</p>").count("a &lt; b")
    1
    """
    from servotwin import __version__

    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<style>{STYLE}{style}</style></head>
<body>
{body}<footer>servotwin {escape(__version__)}. This page loads nothing from the network.</footer>
</body></html>
"""
