//! What people see of a mission: the page while it flies and the reports afterwards.
//!
//! All of it is self-contained: HTML and scripts come from this program, and
//! nothing is fetched from a network.
//!
//! ```
//! use air::geo::LocalFrame;
//! use std::sync::Arc;
//! use views::{live::LiveState, site::SiteMap};
//!
//! let site = SiteMap {
//!     mission: "as-pontes".to_owned(),
//!     shown: record::colour::Shown::CO2,
//!     conditions: Vec::new(),
//!     duration_s: 600.0,
//!     frame: LocalFrame::new(43.4417, -7.8631, 340.0)?,
//!     stacks: Vec::new(),
//!     fence: Vec::new(),
//!     height_band_amsl_m: (400.0, 1200.0),
//!     bounds: Vec::new(),
//!     keep_out_radius_m: 1000.0,
//!     known_ground_amsl_m: Arc::new(|_| Some(340.0)),
//!     has_terrain: false,
//!     field: Arc::new(|_, points| vec![449.0; points.len()]),
//!     reality: None,
//!     true_peak: None,
//! };
//! // Messages of the bus go in by `take`; a page that opens gets this.
//! let page = LiveState::new(Arc::new(site)).whole();
//! assert!(page[0].starts_with('{'));
//! # Ok::<(), air::AirError>(())
//! ```
//!
//! - [`live`]: what the page shows, kept small from the messages on the bus;
//! - [`page`]: the web server of the page;
//! - [`foxglove`]: the same mission for Foxglove;
//! - [`server`]: the one way in which these and metrics are served;
//! - [`report`]: `report.html` of a mission;
//! - [`gap_report`]: `report.html` of a gap analysis;
//! - [`campaign_report`]: `campaign.html` of many missions;
//! - [`flux_report`]: `report.html` of an emission rate, with a sheet to sign;
//! - [`tune_report`]: `report.html` of a tuning;
//! - [`Document`]: what a report is made of;
//! - [`tiles`]: raster tiles under the page's map, which [`mbtiles`] reads from a file;
//! - [`site`]: the map they share.

pub mod campaign_report;
mod figure;
mod flux_figures;
pub mod flux_report;
pub mod foxglove;
pub mod gap_report;
mod html;
pub mod live;
mod map_data;
#[cfg_attr(not(feature = "mbtiles"), path = "without_mbtiles.rs")]
pub mod mbtiles;
pub mod page;
pub mod report;
pub mod server;
pub mod site;
pub mod tiles;
pub mod tune_report;

pub use html::{Document, Origin};

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
    #[error("the server of the page stopped: {0}")]
    Server(std::io::Error),
}
