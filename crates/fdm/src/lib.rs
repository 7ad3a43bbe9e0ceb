//! fdm
