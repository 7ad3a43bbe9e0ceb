//! kml
