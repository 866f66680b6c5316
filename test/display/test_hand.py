"""The helpers of `page_hand.py` see on the page what a user would see."""

from __future__ import annotations

from page_hand import SELDOM

# The times of the pictures that run two callbacks; the second is requested 100 ms after the first.
ASKED = """() => new Promise(done => {
  const moments = [], note = moment => { if (moments.push(moment) === 2) done(moments); };
  requestAnimationFrame(note);
  const end = performance.now() + 100;
  while (performance.now() < end);
  requestAnimationFrame(note);
})"""


def test_all_that_was_asked_for_before_a_picture_is_in_it(browser):
    page = browser.new_page()
    page.add_init_script(SELDOM)
    page.goto("about:blank")
    first, second = page.evaluate(ASKED)
    page.close()
    assert first == second


def test_a_picture_that_took_long_does_not_put_off_the_next_for_as_long(browser):
    """Otherwise, on a slow machine, each picture would be put off longer than the last."""
    page = browser.new_page()
    page.add_init_script(SELDOM)
    page.goto("data:text/html,<p>")
    delays_ms = page.evaluate("""() => new Promise(done => requestAnimationFrame(() => {
      const end = performance.now() + 400;
      while (performance.now() < end);
      const later = window.setTimeout, delays = [];
      window.setTimeout = (act, ms, ...given) => {
        delays.push(ms ?? 0);
        return later(act, ms, ...given);
      };
      later(() => requestAnimationFrame(() => done(delays)), 50);
    }))""")
    page.close()
    assert max(delays_ms) == 500
