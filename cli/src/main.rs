//! The `lunette` command: bakes, relights, judges and shows, by calling the crates that do it.

mod args;
mod bake;
mod compare;
mod day;
mod demo;
mod info;
mod light;
mod output;
mod progress;
mod relight;
mod render;
mod scene;
mod stage;

use std::process::ExitCode;

use clap::Parser;

use args::{Arguments, Command};

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    progress::set_quiet(arguments.quiet);
    let result = match &arguments.command {
        Command::Demo(a) => demo::run(a),
        Command::Scene(a) => scene::run(a),
        Command::Bake(a) => bake::run(a),
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
