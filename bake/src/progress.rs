//! How a bake tells how far it is, and how it is told to stop.

/// Called from tracing threads, so it must be quick.
pub trait Progress: Sync {
    /// `done` of `total` rays of `stage` have been cast.
    fn report(&self, stage: &str, done: u64, total: u64);

    /// Whether to stop as soon as possible.
    fn cancelled(&self) -> bool {
        false
    }

    /// Something that the user should know about the scene or the result, in one line.
    fn note(&self, line: &str) {
        let _ = line;
    }
}

/// Says nothing and never stops.
pub struct Silent;

impl Progress for Silent {
    fn report(&self, _stage: &str, _done: u64, _total: u64) {}
}
