//! How far the work is, on stderr; and Ctrl-C.

use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

static QUIET: AtomicBool = AtomicBool::new(false);
static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Between two plain lines where stderr is no terminal.
const PLAIN_INTERVAL: Duration = Duration::from_secs(10);

/// `--quiet`
pub fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// A line for the user, unless `--quiet`.
pub fn say(line: &str) {
    if !QUIET.load(Ordering::Relaxed) {
        // Who no longer reads what is said still wants the work done.
        let _ = writeln!(std::io::stderr(), "{line}");
    }
}

/// From here on the first Ctrl-C asks the work to stop; the second one ends the process.
pub fn catch_interrupt() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Without a handler Ctrl-C simply ends the process, which leaves nothing half written either.
        let _ = ctrlc::set_handler(|| {
            if CANCELLED.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
    });
}

/// A bar on a terminal, a line every ten seconds elsewhere.
pub struct Bar {
    unit: &'static str,
    scale: f64,
    shown: Mutex<Shown>,
}

struct Shown {
    bar: Option<ProgressBar>,
    last: Instant,
    /// The stage at hand, since when, and what was done before it.
    stage: String,
    started: Instant,
    before: u64,
    greatest: u64,
}

impl Bar {
    /// Counts in `unit`s of `scale` (1e6 for millions).
    pub fn new(unit: &'static str, scale: f64) -> Bar {
        catch_interrupt();
        let is_bar = std::io::stderr().is_terminal() && !QUIET.load(Ordering::Relaxed);
        let bar = is_bar.then(|| {
            let style = ProgressStyle::with_template("{msg:14} {bar:30} {percent:3} %  {prefix}  {eta} left");
            ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        let now = Instant::now();
        let shown = Shown { bar, last: now, stage: String::new(), started: now, before: 0, greatest: 0 };
        Bar { unit, scale, shown: Mutex::new(shown) }
    }

    /// `done` of `total`, in any order and from any thread; one stage after the other.
    pub fn set(&self, stage: &str, done: u64, total: u64) {
        let Ok(mut shown) = self.shown.try_lock() else { return };
        if stage != shown.stage {
            // Speed counts from here: some stages go on counting where the last one ended, some begin at 0.
            (shown.before, shown.greatest) = (done, done);
            shown.stage = stage.to_string();
            shown.started = Instant::now();
            return;
        }
        if done <= shown.greatest {
            return;
        }
        shown.greatest = done;
        let seconds = shown.started.elapsed().as_secs_f64().max(1e-9);
        let speed = (done - shown.before) as f64 / seconds;
        let rate = format!("{:.1} {}/s", speed / self.scale, self.unit);
        if let Some(bar) = &shown.bar {
            bar.set_length(total);
            bar.set_message(stage.to_string());
            bar.set_prefix(rate);
            bar.set_position(done);
        } else if shown.last.elapsed() >= PLAIN_INTERVAL {
            shown.last = Instant::now();
            let left = total.saturating_sub(done) as f64 / speed;
            say(&format!("{stage}: {:.0} %, {rate}, {left:.0} s left", 100.0 * done as f64 / total as f64));
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Ok(shown) = self.shown.lock()
            && let Some(bar) = &shown.bar
        {
            bar.finish_and_clear();
        }
    }
}

impl lunette_bake::Progress for Bar {
    fn report(&self, stage: &str, done: u64, total: u64) {
        self.set(stage, done, total);
    }

    fn cancelled(&self) -> bool {
        CANCELLED.load(Ordering::Relaxed)
    }

    fn note(&self, line: &str) {
        say(line);
    }
}
