//! Sets `cfg(mj4)` if mujoco-sys was built for MuJoCo 4.x.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(mj4)");
    let version: u32 = std::env::var("DEP_MUJOCO_VERSION_HEADER").ok().and_then(|v| v.parse().ok()).unwrap_or(0);
    if version >= 4_000_000 {
        println!("cargo::rustc-cfg=mj4");
    }
}
