@echo off
rem Runs after the post of a CAM system: G-code in, KUKA program out, findings in a log.
rem
rem     gcode2krl_after_post.bat PART.nc [CELL.toml] [/quiet]
rem
rem PART.src, PART.dat and PART.gcode2krl.log are written beside PART.nc. Exit code: 0 written, 1 refused,
rem 2 not understood, 9009 gcode2krl not found. The log opens in a window unless the code is 0 or /quiet is given.
rem Without CELL.toml, the cell is the one in the variable GCODE2KRL_CELL, else the demonstration cell. The
rem variable GCODE2KRL names the program where it is not on the path: C:\venv\Scripts\gcode2krl.exe
setlocal EnableExtensions DisableDelayedExpansion

set "PART=%~f1"
set "PLACE=%~dpn1"
if "%~1"=="" (
    echo usage: gcode2krl_after_post.bat PART.nc [CELL.toml] [/quiet]
    exit /b 2
)
set "CELL=%GCODE2KRL_CELL%"
set "QUIET="
if /i "%~2"=="/quiet" set "QUIET=1"
if /i "%~3"=="/quiet" set "QUIET=1"
if "%~2"=="" goto named
if /i "%~2"=="/quiet" goto named
set "CELL=%~f2"

:named
if not defined GCODE2KRL set "GCODE2KRL=gcode2krl.exe"
set "LOG=%PLACE%.gcode2krl.log"
set "PYTHONUTF8=1"
set "NO_COLOR=1"

rem An old program must not be taken for the new one where this one is refused.
if exist "%PLACE%.src" move /y "%PLACE%.src" "%PLACE%.src.old" >nul
if exist "%PLACE%.dat" move /y "%PLACE%.dat" "%PLACE%.dat.old" >nul

if defined CELL goto with_cell
"%GCODE2KRL%" "%PART%" -o "%PLACE%.src" > "%LOG%" 2>&1
set "CODE=%ERRORLEVEL%"
goto told

:with_cell
"%GCODE2KRL%" "%PART%" --cell "%CELL%" -o "%PLACE%.src" > "%LOG%" 2>&1
set "CODE=%ERRORLEVEL%"

:told
if "%CODE%"=="9009" echo gcode2krl was not found: set GCODE2KRL to the full path of gcode2krl.exe>> "%LOG%"
type "%LOG%"
if "%CODE%"=="0" goto done
if defined QUIET goto done
start "" notepad.exe "%LOG%"

:done
exit /b %CODE%
