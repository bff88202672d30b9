//! The `lunette` command: bakes, relights, judges and shows, by calling the crates that do it.

mod args;
mod bake;
mod compare;
mod day;
mod demo;
mod engine;
mod find;
mod glossy;
mod info;
mod judge;
mod light;
mod moving;
mod output;
mod portals;
mod progress;
mod relight;
mod render;
mod scene;
mod stage;

use std::process::ExitCode;

use clap::Parser;
use clap::error::ErrorKind;

use args::{Arguments, Command};

fn main() -> ExitCode {
    end_with_the_pipe();
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    progress::set_quiet(arguments.quiet);
    let result = match &arguments.command {
        Command::Demo(a) => demo::run(a),
        Command::Scene(a) => scene::run(a),
        Command::Bake(a) => bake::run(a),
        Command::Portals(a) => find::run(a),
        Command::Relight(a) => relight::run(a),
        Command::Render(a) => render::run(a),
        Command::Compare(a) => compare::run(a),
        Command::Info(a) => info::run(a),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let line = format!("{error:#}").replace('\n', " ");
            eprintln!("lunette: {line}");
            ExitCode::FAILURE
        }
    }
}

/// The command line makes no sense.
const USAGE: u8 = 2;

/// Help as it is; what is wrong with the command line in one line.
fn refuse(error: &clap::Error) -> ExitCode {
    let status = match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            let _ = error.print();
            return ExitCode::SUCCESS;
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            return ExitCode::from(USAGE);
        }
        // A known option with an impossible value counts as every other bad input.
        ErrorKind::InvalidValue | ErrorKind::ValueValidation => ExitCode::FAILURE,
        _ => ExitCode::from(USAGE),
    };
    let text = error.to_string();
    let lines =
        text.lines().map(str::trim).take_while(|l| !l.starts_with("Usage:") && !l.starts_with("For more"));
    let line = lines.filter(|l| !l.is_empty()).collect::<Vec<_>>().join(" ");
    eprintln!("lunette: {} (see --help)", line.trim_start_matches("error: "));
    status
}

/// A reader that has seen enough (`lunette info FILE | head`) is no error: Rust's print panics there, and the command
/// ends instead, as others do.
fn end_with_the_pipe() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if info.payload_as_str().is_some_and(|what| what.contains("Broken pipe")) {
            std::process::exit(0);
        }
        usual(info);
    }));
}
