//! What people see of a mission: the page while it flies and the reports afterwards.
//!
//! All of it is self-contained: HTML, script and plotting library come from this program, and
//! nothing is fetched from a network.
//!
//! - [`live`]: what the page shows, kept small from the messages on the bus;
//! - [`page`]: the web server of the page;
//! - [`report`]: `report.html` of a mission;
//! - [`gap_report`]: `report.html` of a gap analysis;
//! - [`tune_report`]: `report.html` of a tuning;
//! - [`site`]: the map they share.

pub mod gap_report;
mod html;
pub mod live;
pub mod page;
mod plot;
mod plotly_js;
pub mod report;
pub mod site;
pub mod tune_report;

/// Why a view could not be shown.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The page's address is in use or may not be used.
    #[error("cannot serve the page at {address}: {source}")]
    Address {
        /// Where the page should be.
        address: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The web server stopped.
    #[error("the page's server stopped: {0}")]
    Server(std::io::Error),
}
