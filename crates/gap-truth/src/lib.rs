//! gap-truth
