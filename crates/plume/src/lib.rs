//! plume
