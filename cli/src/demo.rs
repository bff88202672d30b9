//! `lunette demo`
use crate::args;
use anyhow::Result;
/// `lunette demo`
pub fn run(_arguments: &args::Demo) -> Result<()> {
    Ok(())
}
