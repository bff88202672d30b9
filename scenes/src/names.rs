//! Names numbered in the order in which they come.

use std::collections::HashMap;

/// A table of different names.
#[derive(Default)]
pub(crate) struct Names {
    /// In order of their numbers.
    pub list: Vec<String>,
    index: HashMap<String, u32>,
}

impl Names {
    /// The number of a name; a new one gets the next.
    pub fn index(&mut self, name: &str) -> u32 {
        if let Some(&index) = self.index.get(name) {
            return index;
        }
        let index = self.list.len() as u32;
        self.list.push(name.to_owned());
        self.index.insert(name.to_owned(), index);
        index
    }

    /// The number of a name that may be there.
    pub fn find(&self, name: &str) -> Option<u32> {
        self.index.get(name).copied()
    }
}

/// `"1 triangle"`, `"2 triangles"`.
pub(crate) fn count(n: usize, thing: &str) -> String {
    let plural = thing.strip_suffix("ex").map_or_else(|| format!("{thing}s"), |stem| format!("{stem}ices"));
    if n == 1 { format!("1 {thing}") } else { format!("{n} {plural}") }
}

/// The first few names, for a report: `a, b, c and 4 more`.
pub(crate) fn some(names: &[String]) -> String {
    const SHOWN: usize = 3;
    let shown = names[..names.len().min(SHOWN)].join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}
