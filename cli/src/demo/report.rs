//! The demo's page.

use std::fmt::Write as _;

use lunette_bake::Options;

use super::chapters::Kind;
use super::{Shown, Told, Tried};
use crate::judge::Row;

/// How the page looks.
const STYLE: &str = "body{font:16px/1.5 sans-serif;max-width:1340px;margin:2em auto;padding:0 1em;color:#222}\
    figure{display:inline-block;width:32%;min-width:300px;margin:0 .6% 1em 0;vertical-align:top}\
    img{width:100%}figcaption{font-size:.85em;color:#555}\
    table{border-collapse:collapse;margin:1em 0}td,th{padding:.15em .8em;text-align:right;border-bottom:1px solid #ddd}\
    td:first-child,th:first-child{text-align:left}.note{font-size:.85em;color:#555}p{max-width:50em}";

/// The whole page; its pictures lie beside it.
pub fn page(told: &[Told], options: &Options, threads: usize, seconds: f64) -> String {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" \
         content=\"width=device-width\"><title>Lunette demo</title><style>{STYLE}</style>\n<h1>Lunette demo</h1>\n"
    );
    let _ = writeln!(
        page,
        "<p>{} scenes, each baked once ({} bounces; under the open sky direct light to order {}, bounced light to \
         order {}), then relit. Everything here was made and measured by this run, in {seconds:.0} s on {threads} \
         threads.</p>",
        told.len(),
        options.bounces,
        options.order,
        options.indirect_order
    );
    told.iter().for_each(|chapter| section(&mut page, chapter));
    page.push_str(&summary(told));
    page
}

fn section(page: &mut String, told: &Told) {
    let chapter = told.chapter;
    let _ = writeln!(page, "<h2>{}</h2>\n<p>{}</p>", chapter.title, chapter.text);
    let _ = writeln!(
        page,
        "<p class=note>{}: {} vertices, {} rays each, all bases baked together in {:.1} s, {:.1} MB</p>",
        chapter.scene, told.vertices, chapter.rays, told.bake_seconds, told.megabytes
    );
    figures(page, &told.pictures);
    for tried in &told.trials {
        let _ = writeln!(page, "<h3>Measured under <code>{}</code></h3>", tried.trial.light);
        figures(page, &tried.pictures);
        table(page, tried, chapter.kind);
    }
}

fn figures(page: &mut String, pictures: &[Shown]) {
    for Shown { file, caption } in pictures {
        let _ = writeln!(
            page,
            "<figure><img src=\"{file}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>"
        );
    }
}

fn table(page: &mut String, tried: &Tried, kind: Kind) {
    page.push_str(
        "<table><tr><th>method<th>relative difference<th>direct<th>bounced<th>99th percentile<th>bytes per vertex<th>bake, s\
         <th>relight, ms</tr>\n",
    );
    for r in &tried.rows {
        let (d, p) = (r.percent(), 100.0 * r.percentile_99);
        let [direct, bounced] = r.percent_of_parts();
        let _ = writeln!(
            page,
            "<tr><td>{}<td>{d} %<td>{direct} %<td>{bounced} %<td>{p:.1} %<td>{:.0}<td>{:.1}<td>{:.2}</tr>",
            r.name,
            r.bytes.0 + r.bytes.1,
            r.bake_seconds,
            r.relight_milliseconds
        );
    }
    let note = match kind {
        Kind::OpenSky => {
            "One bake made all methods; with its ten bands in the file, a frame of sh3 or sh5 reads them all, and \
             takes as long as sh10"
        }
        Kind::Interior => "Each method has a bake of its own",
    };
    let _ = writeln!(page, "</table><p class=note>{}. {note}.</p>", tried.judge);
}

/// Each method's best and worst case among the trials.
fn summary(told: &[Told]) -> String {
    let cases = told.iter().flat_map(|t| t.trials.iter().map(move |tried| (t, tried)));
    let cases: Vec<Case> =
        cases.flat_map(|(t, tried)| tried.rows.iter().map(move |row| (t, tried, row))).collect();
    let mut text = String::from(
        "<h2>Where each method breaks</h2>\n<p>Relative difference against the reference: the best and the worst \
         of the cases above.</p>\n<table><tr><th>method<th>best<th>where<th>worst<th>where</tr>\n",
    );
    let mut names: Vec<&str> = Vec::new();
    cases.iter().for_each(|(_, _, row)| {
        if !names.contains(&row.name.as_str()) {
            names.push(&row.name);
        }
    });
    let by_error = |a: &&Case, b: &&Case| a.2.relative.total.total_cmp(&b.2.relative.total);
    for name in names {
        let of_name = || cases.iter().filter(|case| case.2.name == name);
        let (Some(best), Some(worst)) = (of_name().min_by(by_error), of_name().max_by(by_error)) else {
            continue;
        };
        let cell = |(told, tried, row): &Case| {
            let (scene, light) = (told.chapter.name(), tried.trial.light);
            format!("<td>{} %<td>{scene}, <code>{light}</code>", row.percent())
        };
        let _ = writeln!(text, "<tr><td>{name}{}{}</tr>", cell(best), cell(worst));
    }
    text.push_str("</table>\n");
    text
}

/// A method under a light.
type Case<'a> = (&'a Told, &'a Tried, &'a Row);
