//! What an analysis of tracer trials tells.

use gap::tracer::table::Tables;
use gap::tracer::{TracerReport, analyse};

/// The report on trials; loud where they are refused.
pub fn report(tables: &Tables) -> TracerReport {
    analyse(tables, 1, &mut |_| {}).unwrap()
}

/// The mechanisms of vertical spread and loss that are named.
pub fn vertical(report: &TracerReport) -> Vec<&str> {
    let ids = [
        "sigma-z-growth",
        "sigma-z-scale",
        "dry-deposition",
        "first-order-decay",
    ];
    let causes = report
        .gap
        .causes
        .iter()
        .flat_map(|c| &c.mechanisms)
        .map(String::as_str);
    causes.filter(|m| ids.contains(m)).collect()
}
