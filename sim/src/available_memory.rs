//! Memory that this process may still use, as far as Linux tells. A system that grants more memory than it has ends the
//! process when the memory is used, so a large allocation is checked before.

use std::path::Path;

/// Memory that this process may still use \[bytes\]: the least of the available memory of the machine and the limits of
/// its control groups. `None` if the system does not tell.
pub(crate) fn available_memory() -> Option<usize> {
    of_system(Path::new("/"))
}

/// As [`available_memory`], from the files below `root`.
fn of_system(root: &Path) -> Option<usize> {
    let groups = std::fs::read_to_string(root.join("proc/self/cgroup")).unwrap_or_default();
    let limits = groups.lines().flat_map(|group| group_limits(root, group));
    machine(root).into_iter().chain(limits).min()
}

/// Available memory and free swap space of the machine \[bytes\]. `None` without `meminfo`. Source: proc(5), `meminfo`,
/// whose numbers are in KiB.
fn machine(root: &Path) -> Option<usize> {
    let text = std::fs::read_to_string(root.join("proc/meminfo")).ok()?;
    let of = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key))?;
        line.split_whitespace().next()?.parse::<usize>().ok()
    };
    Some((of("MemAvailable:")? + of("SwapFree:").unwrap_or(0)).saturating_mul(1024))
}

/// Memory that the limits of a control group and of the groups that contain it leave \[bytes\]. `group` is a line of
/// `/proc/self/cgroup`: `0::/path` for version 2, `4:memory:/path` for version 1.
fn group_limits(root: &Path, group: &str) -> Vec<usize> {
    let mut parts = group.splitn(3, ':').skip(1);
    let (folder, limit, used, prefix) = match parts.next() {
        Some("") => ("sys/fs/cgroup", "memory.max", "memory.current", ""),
        Some(controllers) if controllers.split(',').any(|controller| controller == "memory") => {
            ("sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_")
        }
        _ => return Vec::new(),
    };
    let path = parts.next().unwrap_or_default().trim_matches('/');
    // In a container, the path may be that of the host: then only the top group is visible.
    let folders = Path::new(path).ancestors().map(|path| root.join(folder).join(path));
    let left = |folder: &Path| {
        let number = |file: &str| std::fs::read_to_string(folder.join(file)).ok()?.trim().parse::<usize>().ok();
        let stat = std::fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
        // Cached files and caches of the kernel give way to allocations.
        let of = |line: &str| {
            let (key, value) = line.strip_prefix(prefix)?.split_once(' ')?;
            let is_cache = ["inactive_file", "active_file", "slab_reclaimable"].contains(&key);
            if is_cache { value.trim().parse::<usize>().ok() } else { None }
        };
        let cached: usize = stat.lines().filter_map(of).sum();
        // A group without a limit has the word `max`, or a number above any memory.
        Some(number(limit)?.saturating_sub(number(used)?.saturating_sub(cached)))
    };
    folders.filter_map(|folder| left(&folder)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn system(files: &[(&str, &str)]) -> Option<usize> {
        let root = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            let path = root.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, text).expect("a file");
        }
        of_system(root.path())
    }

    const MEMINFO: (&str, &str) =
        ("proc/meminfo", "MemTotal: 9000 kB\nMemFree: 10 kB\nMemAvailable:    8000 kB\nSwapFree: 100 kB\n");

    #[test]
    fn machine_alone() {
        assert_eq!(system(&[]), None);
        assert_eq!(system(&[MEMINFO]), Some(8100 << 10));
        let unlimited = [MEMINFO, ("proc/self/cgroup", "0::/a\n"), ("sys/fs/cgroup/a/memory.max", "max\n")];
        assert_eq!(system(&unlimited), Some(8100 << 10));
    }

    #[test]
    fn control_groups() {
        let inner = ("sys/fs/cgroup/a/b/memory.max", "max\n");
        let outer = [
            ("sys/fs/cgroup/a/memory.max", "5000\n"),
            ("sys/fs/cgroup/a/memory.current", "4500\n"),
            ("sys/fs/cgroup/a/memory.stat", "anon 1\ninactive_file 300\nactive_file 50\nslab_reclaimable 7\nfile 2\n"),
        ];
        let version2 = [&[MEMINFO, ("proc/self/cgroup", "0::/a/b\n"), inner][..], &outer].concat();
        assert_eq!(system(&version2), Some(5000 - 4500 + 357));
        let version1 = [
            MEMINFO,
            ("proc/self/cgroup", "5:cpu:/x\n4:blkio,memory:/x\n"),
            ("sys/fs/cgroup/memory/x/memory.limit_in_bytes", "7000\n"),
            ("sys/fs/cgroup/memory/x/memory.usage_in_bytes", "7200\n"),
            ("sys/fs/cgroup/memory/x/memory.stat", "inactive_file 9\ntotal_inactive_file 500\ntotal_active_file 40\n"),
        ];
        assert_eq!(system(&version1), Some(340));
        // A group that is not visible limits nothing.
        assert_eq!(system(&[MEMINFO, ("proc/self/cgroup", "0::/../elsewhere\n")]), Some(8100 << 10));
    }

    #[test]
    fn this_machine() {
        if cfg!(target_os = "linux") {
            assert!(available_memory().is_some_and(|bytes| bytes > 1 << 20));
        }
    }
}
