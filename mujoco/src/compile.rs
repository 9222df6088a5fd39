//! Compilation of MJCF: text with assets in memory, or files on disk.

use super::error::CompileError;
use super::input_limits;
use super::model::Compiled;
use super::version::{VersionError, check_version};
use mujoco_sys as mj;
use std::alloc::{Layout, alloc_zeroed, dealloc, handle_alloc_error};
use std::ffi::{CStr, CString, c_char};
use std::path::Path;
use std::ptr::NonNull;

/// A file that the MJCF refers to, held in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    /// Name without folders, lower case and unique: 2.2.2 strips folders from the names in the MJCF and converts them
    /// to lower case.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Error of [`compile`] and [`compile_file`].
#[derive(Clone, Debug, thiserror::Error)]
pub enum LoadError {
    /// Header and library versions differ.
    #[error(transparent)]
    Version(#[from] VersionError),
    /// MuJoCo rejected the model.
    #[error(transparent)]
    Compile(#[from] CompileError),
}

/// MuJoCo's virtual file system. On 2.2.2 the struct has 2 MB, so it lives on the heap.
struct Vfs(NonNull<mj::mjVFS>);

/// Longest name of a file \[bytes\]: 2.2.2 stores this many and a NUL.
const LONGEST_NAME: usize = 999;

impl Vfs {
    fn new() -> Self {
        let layout = Layout::new::<mj::mjVFS>();
        // SAFETY: the layout is not of size zero.
        let raw = unsafe { alloc_zeroed(layout) }.cast::<mj::mjVFS>();
        let Some(raw) = NonNull::new(raw) else { handle_alloc_error(layout) };
        // SAFETY: `raw` points to zeroed memory of the right size.
        unsafe { mj::mj_defaultVFS(raw.as_ptr()) };
        Self(raw)
    }

    /// Returns false if the file cannot be added (name used twice or with a NUL, table full, 2 GiB or more).
    fn add(&mut self, asset: &Asset) -> bool {
        let (Ok(name), Ok(size)) = (CString::new(asset.name.as_str()), i32::try_from(asset.bytes.len())) else {
            return false;
        };
        self.add_bytes(&name, &asset.bytes, size)
    }

    #[cfg(mj4)]
    fn add_bytes(&mut self, name: &CStr, bytes: &[u8], size: i32) -> bool {
        // SAFETY: the VFS is initialized; name and buffer are alive; MuJoCo copies the bytes.
        unsafe { mj::mj_addBufferVFS(self.0.as_ptr(), name.as_ptr(), bytes.as_ptr().cast(), size) == 0 }
    }

    #[cfg(not(mj4))]
    fn add_bytes(&mut self, name: &CStr, bytes: &[u8], size: i32) -> bool {
        // SAFETY: the VFS is initialized and the name is NUL-terminated; on success MuJoCo has allocated `size` bytes.
        if unsafe { mj::mj_makeEmptyFileVFS(self.0.as_ptr(), name.as_ptr(), size) } != 0 {
            return false;
        }
        // SAFETY: as above.
        let index = unsafe { mj::mj_findFileVFS(self.0.as_ptr(), name.as_ptr()) };
        let Ok(index) = usize::try_from(index) else { return false };
        // SAFETY: `self.0` is a valid, initialized VFS without other references.
        let vfs = unsafe { self.0.as_mut() };
        let destination = vfs.filedata[index].cast::<u8>();
        // SAFETY: the file was just made with `bytes.len()` bytes; source and destination are different allocations.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), destination, bytes.len()) };
        true
    }
}

impl Drop for Vfs {
    fn drop(&mut self) {
        // SAFETY: the VFS was initialized in `new`.
        unsafe { mj::mj_deleteVFS(self.0.as_ptr()) };
        // SAFETY: allocated in `new` with the same layout.
        unsafe { dealloc(self.0.as_ptr().cast(), Layout::new::<mj::mjVFS>()) };
    }
}

/// Compiles MJCF text that this program has written. Files that it names are looked up in `assets` first, then on disk. Text of
/// a user is for [`compile_text`], which has limits of numbers.
///
/// # Errors
/// MuJoCo's version does not match, MuJoCo rejects the model, or an asset is empty or has an invalid or repeated name
/// (`model.xml` is reserved).
pub fn compile(mjcf: &str, assets: &[Asset]) -> Result<Compiled, LoadError> {
    check_version()?;
    let mut vfs = Vfs::new();
    let model = Asset { name: "model.xml".into(), bytes: mjcf.as_bytes().to_vec() };
    for asset in std::iter::once(&model).chain(assets) {
        // 2.2.2 would end the process.
        let base_name = (1..=LONGEST_NAME).contains(&asset.name.len()) && !asset.name.contains(['/', '\\']);
        if asset.bytes.is_empty() || !base_name {
            let message = format!(
                "the asset {:?} is empty, or its name is not a base name (no slash) of 1 to {LONGEST_NAME} bytes",
                asset.name
            );
            return Err(CompileError::new(&message).into());
        }
        if !vfs.add(asset) {
            let message =
                format!("the asset {:?} cannot be added: its name is used twice or it is too large", asset.name);
            return Err(CompileError::new(&message).into());
        }
    }
    load(c"model.xml", vfs.0.as_ptr())
}

/// Compiles MJCF text of a user. Files that it names are looked up on disk.
///
/// # Errors
/// As those of [`compile_file`].
pub fn compile_text(mjcf: &str) -> Result<Compiled, LoadError> {
    input_limits::check_text(mjcf)?;
    compile(mjcf, &[])
}

/// Compiles an MJCF file. Files that it names are looked up on disk, by MuJoCo's rules.
///
/// # Errors
/// MuJoCo's version does not match, MuJoCo rejects the file, or a length in it or in a file that it includes is not a number
/// from -1e8 to 1e8, or copies, pixels or cells are too many.
pub fn compile_file(path: impl AsRef<Path>) -> Result<Compiled, LoadError> {
    let path = path.as_ref();
    check_version()?;
    let name = CString::new(path.to_string_lossy().as_bytes())
        .map_err(|_| CompileError::new(&format!("{path:?} contains a NUL character")))?;
    input_limits::check_file(path)?;
    load(&name, std::ptr::null()).map_err(|error| match error {
        LoadError::Compile(error) => error.with_location_in(path).into(),
        other => other,
    })
}

fn load(name: &CStr, vfs: *const mj::mjVFS) -> Result<Compiled, LoadError> {
    let mut error: [c_char; 1024] = [0; 1024];
    // SAFETY: name and error buffer are alive and of the stated size; `vfs` is null or initialized. Errors inside are
    // reported through the buffer (both versions install a handler of their own while they compile).
    let raw = unsafe { mj::mj_loadXML(name.as_ptr(), vfs, error.as_mut_ptr(), error.len() as i32) };
    if let Some(raw) = NonNull::new(raw) {
        // SAFETY: a new model without another owner.
        return Ok(unsafe { Compiled::from_raw(raw) });
    }
    // SAFETY: MuJoCo terminates the message within the buffer, which started as zeros.
    let message = unsafe { CStr::from_ptr(error.as_ptr()) }.to_string_lossy().into_owned();
    Err(CompileError::new(&message).into())
}
