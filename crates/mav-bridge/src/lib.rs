//! mav-bridge
