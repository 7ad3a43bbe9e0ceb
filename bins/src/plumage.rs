//! plumage
fn main() {}
