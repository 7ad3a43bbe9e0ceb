//! Options that are none.

use std::process::Command;

#[test]
fn a_name_that_no_case_has_is_wrong_usage() {
    for more in [&[][..], &["--flight"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_gap-bench"))
            .args(["--only", "nosuch"])
            .args(more)
            .env("RUST_BACKTRACE", "1")
            .output()
            .unwrap();
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains("--only nosuch: no "), "{told}");
        assert!(!told.to_lowercase().contains("backtrace"), "{told}");
    }
}
