//! Plugins that ship with MuJoCo 4: shared libraries in a folder beside the library.

/// Does nothing, because 2.2.2 has no plugins.
#[cfg(not(mj4))]
pub(super) fn load() {}

/// Loads the plugins beside the MuJoCo library of this process: in `plugin` (wheel) and `bin/mujoco_plugin` (release).
#[cfg(mj4)]
pub(super) fn load() {
    use std::ffi::CString;
    use std::os::unix::ffi::OsStrExt;

    let Some(folder) = library_folder() else { return };
    let folders = [folder.join("plugin"), folder.join("../bin/mujoco_plugin")];
    for folder in folders.into_iter().filter(|folder| folder.is_dir()) {
        let Ok(folder) = CString::new(folder.as_os_str().as_bytes()) else { continue };
        // SAFETY: the path is NUL-terminated and alive; without a callback, MuJoCo calls no function of this crate.
        unsafe { mujoco_sys::mj_loadAllPluginLibraries(folder.as_ptr(), None) };
    }
}

/// Folder of the MuJoCo library that this process has loaded, from the kernel's list; `None` if the library is not in
/// the list.
#[cfg(mj4)]
fn library_folder() -> Option<std::path::PathBuf> {
    let maps = std::fs::read_to_string("/proc/self/maps").ok()?;
    let path = maps
        .lines()
        .filter_map(|line| line.find('/').map(|at| &line[at..]))
        .find(|path| path.rsplit('/').next().is_some_and(|name| name.starts_with("libmujoco.so")))?;
    std::path::Path::new(path).parent().map(std::path::Path::to_path_buf)
}
