//! An extension found before, on other data: `--apply`.

use super::output::{OutputArguments, tell_causes};
use crate::{Failure, measured, reports};
use gap::applied::Earlier;
use gap::plume::Analysis;
use gap::tracer::table::Tables;
use gap::verdict::GapJson;
use record::files;
use std::path::Path;
use views::Document;

/// Reads an earlier finding.
///
/// # Errors
/// A file that cannot be read or is no `gap.json` of a finding.
pub(super) fn earlier(file: &Path, out: &Path) -> Result<Earlier, Failure> {
    let text = measured::read(file, "gap.json")?;
    let whole = |path: &Path| path.canonicalize().ok();
    let beside = whole(file)
        .as_deref()
        .and_then(Path::parent)
        .map(Path::to_owned);
    if beside.is_some() && beside == whole(out) {
        return Err(Failure::usage(format!(
            "--out {}: holds {}, which --apply reads; expected another folder",
            out.display(),
            file.display()
        )));
    }
    Earlier::parse(&file.display().to_string(), &text).map_err(Failure::input)
}

/// Scores an earlier finding on trials.
pub(super) fn to_tracer(
    tables: &Tables,
    file: &Path,
    title: &str,
    output: &OutputArguments,
) -> Result<(), Failure> {
    let earlier = earlier(file, &output.out)?;
    let report = gap::tracer::apply(tables, &earlier, output.seed).map_err(Failure::input)?;
    let page = views::gap_report::applied_tracer(title, &report);
    write(output, &report.to_json()?, &page)?;
    tell(&report.gap, "air", &output.out);
    Ok(())
}

/// Writes and tells what earlier causes came to on readings.
pub(super) fn of_plume(
    analysis: &Analysis,
    title: &str,
    output: &OutputArguments,
) -> Result<(), Failure> {
    let page = views::gap_report::applied_plume(title, &analysis.json, &analysis.report);
    write(output, &analysis.json.to_json()?, &page)?;
    measured::tell_flaws(&analysis.json.data_quality);
    tell(&analysis.json, "", &output.out);
    Ok(())
}

/// Writes what an application has to write; an earlier extension in the folder would be taken for its own.
pub(super) fn write(
    output: &OutputArguments,
    json: &str,
    report: &Document,
) -> Result<(), Failure> {
    let report = reports::html(report);
    files::prepare_folder(&output.out, output.force).map_err(Failure::input)?;
    let outputs = [("report.html", &report[..]), ("gap.json", json)];
    let outputs = outputs.map(|(name, text)| (output.out.join(name), text.as_bytes()));
    Ok(files::write_set(&outputs)?)
}

/// Tells what was applied and what it came to.
pub(super) fn tell(json: &GapJson, platforms: &str, folder: &Path) {
    measured::tell(&json.notices);
    let Some(applied) = &json.applied else { return };
    println!("{}", applied.says);
    println!("  Applied causes from {}:", applied.from);
    if json.causes.is_empty() {
        println!("  none");
    }
    tell_causes(&json.causes, platforms);
    if applied.fitted.is_empty() {
        println!("  Fitted to these data: none");
    } else {
        println!(
            "  Base parameters fitted to these data: {}",
            applied.fitted.join(", ")
        );
    }
    for s in &applied.scores {
        println!(
            "  {} of {} arcs{}: FAC2 {:.2} to {:.2}, NMSE {:.2} to {:.2}, rms ln {:.2} to {:.2}",
            s.what,
            s.count,
            s.of.as_ref()
                .map_or_else(String::new, |of| format!(" in {of} {platforms}")),
            s.fac2_before,
            s.fac2_after,
            s.nmse_before,
            s.nmse_after,
            s.rms_ln_before,
            s.rms_ln_after
        );
    }
    println!("Outputs in {}: gap.json, report.html", folder.display());
}
