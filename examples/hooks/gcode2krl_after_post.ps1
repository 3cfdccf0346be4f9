<#
.SYNOPSIS
Runs after the post of a CAM system: G-code in, KUKA program out, findings in a log.
.DESCRIPTION
PART.src, PART.dat and PART.gcode2krl.log are written beside PART.nc. Exit code: 0 written, 1 refused, 2 not
understood, 3 gcode2krl not found. The log opens in a window unless the code is 0 or -Quiet is given.
.EXAMPLE
powershell.exe -NoProfile -ExecutionPolicy Bypass -File gcode2krl_after_post.ps1 -Part "C:\my parts\a.nc" -Cell "C:\cells\cell.toml"
#>
param(
    [Parameter(Mandatory = $true)] [string] $Part,
    [string] $Cell = $env:GCODE2KRL_CELL,
    [string] $Program = $(if ($env:GCODE2KRL) { $env:GCODE2KRL } else { 'gcode2krl.exe' }),
    [switch] $Quiet
)
$ErrorActionPreference = 'Stop'

$Part = [IO.Path]::GetFullPath($Part)
$place = Join-Path ([IO.Path]::GetDirectoryName($Part)) ([IO.Path]::GetFileNameWithoutExtension($Part))
$log = "$place.gcode2krl.log"
$command = Get-Command -Name $Program -CommandType Application -ErrorAction SilentlyContinue | Select-Object -First 1
if (-not $command) {
    "gcode2krl was not found: set GCODE2KRL to the full path of gcode2krl.exe" | Out-File -LiteralPath $log -Encoding utf8
    Get-Content -LiteralPath $log
    exit 3
}

# An old program must not be taken for the new one where this one is refused.
foreach ($ending in '.src', '.dat') {
    if (Test-Path -LiteralPath "$place$ending") {
        Move-Item -LiteralPath "$place$ending" -Destination "$place$ending.old" -Force
    }
}

# No path has a quotation mark in it, so each argument is quoted by itself; Windows PowerShell 5.1 would turn
# lines on standard error into exceptions if the program were called directly.
$words = @($Part)
if ($Cell) { $words += '--cell', [IO.Path]::GetFullPath($Cell) }
$words += '-o', "$place.src"
$start = New-Object System.Diagnostics.ProcessStartInfo
$start.FileName = $command.Path
$start.Arguments = ($words | ForEach-Object { '"' + $_ + '"' }) -join ' '
$start.UseShellExecute = $false
$start.CreateNoWindow = $true
$start.RedirectStandardOutput = $true
$start.RedirectStandardError = $true
$start.StandardOutputEncoding = [Text.Encoding]::UTF8
$start.StandardErrorEncoding = [Text.Encoding]::UTF8
$start.EnvironmentVariables['PYTHONUTF8'] = '1'
$start.EnvironmentVariables['NO_COLOR'] = '1'
$process = [System.Diagnostics.Process]::Start($start)
$summary = $process.StandardOutput.ReadToEndAsync()
$findings = $process.StandardError.ReadToEnd()
$process.WaitForExit()

[IO.File]::WriteAllText($log, $findings + $summary.Result, (New-Object Text.UTF8Encoding $true))
Get-Content -LiteralPath $log -Encoding UTF8
if ($process.ExitCode -ne 0 -and -not $Quiet) {
    Start-Process -FilePath notepad.exe -ArgumentList ('"' + $log + '"')
}
exit $process.ExitCode
